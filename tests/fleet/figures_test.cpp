#include "fleet/figures.h"

#include <cmath>

#include <gtest/gtest.h>

namespace vgyro::fleet {
namespace {

TEST(Figures, HaveTheDigitsThatTheirSigmaHasAUseFor) {
  EXPECT_EQ(figure(0.0193512, 0.00123), "0.0194 ± 0.0012");
  EXPECT_EQ(figure(-0.0195, 0.0003), "-0.0195 ± 0.0003");
  EXPECT_EQ(figure(0.00050114, 3.7e-6), "(501 ± 4)·10⁻⁶");
  EXPECT_EQ(figure(-8.9e-6, 2e-5), "(-9 ± 20)·10⁻⁶");
  EXPECT_EQ(figure(123.4, 30.0), "123 ± 30");
  EXPECT_EQ(figure(4.2e7, 1.5e6), "(42.0 ± 1.5)·10⁶");
  EXPECT_EQ(figure(0.0, 2e-3), "0.000 ± 0.002");
}

TEST(Figures, AreZeroWhereTheirSigmaHidesThem) {
  EXPECT_EQ(rounded_figure(-2.31e-7, 7e-6), "0");
  EXPECT_EQ(rounded_figure(5.01e-4, 2e-5), "501·10⁻⁶");
  EXPECT_EQ(rounded_figure(0.0461, 0.01), "0.046");
}

TEST(Figures, WithoutASigmaHaveThreeDigits) {
  EXPECT_EQ(figure(0.0034567), "0.00346");
  EXPECT_EQ(figure(1.23e-5), "12.3·10⁻⁶");
  EXPECT_EQ(figure(0.0), "0");
  EXPECT_EQ(figure(2.5, 0.0), "2.5");
  EXPECT_EQ(figure(2.5, std::nan("")), "2.5");
}

}  // namespace
}  // namespace vgyro::fleet
