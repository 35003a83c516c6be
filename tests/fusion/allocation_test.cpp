// After start-up the frame path allocates nothing: a slow, full or corrupt heap must not delay or
// stop the rate. Counts every operator new of this program.

#include <atomic>
#include <cstdlib>
#include <new>

#include <gtest/gtest.h>

#include "fusion/alignment.h"
#include "fusion/calibration.h"
#include "fusion/coherence.h"
#include "fusion/corrector.h"
#include "fusion/readings.h"
#include "fusion/stamp_guard.h"
#include "tests/fusion/random.h"

namespace {

std::atomic<std::uint64_t> allocations{0};

void* counted(std::size_t bytes) {
  ++allocations;
  void* const memory = std::malloc(bytes == 0 ? 1 : bytes);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

void* counted_aligned(std::size_t bytes, std::size_t alignment) {
  ++allocations;
  void* const memory =
      std::aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace

// All forms of operator new: if one were missing, its memory would be freed by another allocator's
// delete.
void* operator new(std::size_t bytes) {
  return counted(bytes);
}
void* operator new[](std::size_t bytes) {
  return counted(bytes);
}
void* operator new(std::size_t bytes, const std::nothrow_t& /*tag*/) noexcept {
  ++allocations;
  return std::malloc(bytes);
}
void* operator new[](std::size_t bytes, const std::nothrow_t& /*tag*/) noexcept {
  ++allocations;
  return std::malloc(bytes);
}
void* operator new(std::size_t bytes, std::align_val_t alignment) {
  return counted_aligned(bytes, static_cast<std::size_t>(alignment));
}
void* operator new[](std::size_t bytes, std::align_val_t alignment) {
  return counted_aligned(bytes, static_cast<std::size_t>(alignment));
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete[](void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t /*bytes*/) noexcept {
  std::free(memory);
}
void operator delete[](void* memory, std::size_t /*bytes*/) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::align_val_t /*alignment*/) noexcept {
  std::free(memory);
}
void operator delete[](void* memory, std::align_val_t /*alignment*/) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t /*bytes*/, std::align_val_t /*alignment*/) noexcept {
  std::free(memory);
}
void operator delete[](void* memory, std::size_t /*bytes*/,
                       std::align_val_t /*alignment*/) noexcept {
  std::free(memory);
}

namespace vgyro::fusion {
namespace {

using namespace std::chrono_literals;

constexpr int kSamples = 10'000;
constexpr TimePoint kStart = time_from_ns(1'700'000'000'000'000'000);

/// Allocations while `work` runs.
template <class Work>
std::uint64_t allocations_of(Work&& work) {
  const std::uint64_t before = allocations;
  work();
  return allocations - before;
}

// Without this the other tests could not fail.
TEST(Allocation, IsSeenByTheCounter) {
  std::unique_ptr<Corrector> corrector;
  EXPECT_EQ(allocations_of([&corrector] { corrector = make_mean_corrector(); }), 1U);
  EXPECT_GE(allocations_of([] { std::vector<double> values(100, 1.0); }), 1U);
}

// Samples that wait, are late, refused or cleared: none of these paths uses the heap.
TEST(Allocation, IsNotDoneByTheAligner) {
  Aligner aligner;
  Random random(1);
  std::uint64_t pairs = 0;
  EXPECT_EQ(allocations_of([&] {
              AlignedPair pair;
              for (int i = 0; i < kSamples; ++i) {
                aligner.push(0, kStart + i * 10ms, random.normal());
                // Reordered samples, gaps and long silence cover every path.
                if (i % 1000 < 300) continue;
                aligner.push(1, kStart + (i ^ 1) * 10ms + 3ms, random.normal());
                while (aligner.pop(pair))
                  ++pairs;
                if (i == kSamples / 2) aligner.clear();
              }
            }),
            0U);
  EXPECT_GT(pairs, 1000U);
}

// The mean over an interval needs no memory of its own.
TEST(Allocation, IsNotDoneByAveragingEither) {
  Aligner aligner;
  std::uint64_t pairs = 0;
  EXPECT_EQ(allocations_of([&] {
              AlignedPair pair;
              for (int i = 0; i < kSamples; ++i) {
                aligner.push(0, kStart + i * 2ms, 1.0);
                if (i % 5 == 0) aligner.push(1, kStart + i * 2ms, 1.0);
                while (aligner.pop(pair))
                  ++pairs;
              }
            }),
            0U);
  EXPECT_GT(pairs, 1900U);
}

// A step of the clock is handled in place.
TEST(Allocation, IsNotDoneByTheStampGuard) {
  StampGuard guard;
  EXPECT_EQ(allocations_of([&guard] {
              TimePoint t;
              for (int i = 0; i < kSamples; ++i) {
                const Duration set_back = i > kSamples / 2 ? 3600s : 0s;
                guard.check(static_cast<std::size_t>(i) % 3, kStart + i * 5ms - set_back, t);
              }
            }),
            0U);
  EXPECT_GT(guard.offset(), 3590s) << "the step was taken up";
}

// The small system is solved on the stack, at every order.
TEST(Allocation, IsNotDoneByLeastSquares) {
  for (int order = 0; order <= kOrderMax; ++order) {
    double value = 0.0;
    EXPECT_EQ(allocations_of([&value, order] {
                LeastSquares window(order, 0.0, 100.0);
                for (int i = 0; i < kSamples; ++i)
                  window.add(0.01 * i, 1.0);
                value = window.fit()->polynomial.at(50.0);
              }),
              0U)
        << order;
    EXPECT_NEAR(value, 1.0, 1e-12);
  }
}

// Covers everything from the first pair of the calibration through dozens of windows.
TEST(Allocation, IsNotDoneByCalibratorAndCorrector) {
  for (int order = 0; order <= kOrderMax; ++order) {
    Calibrator calibrator(order, 20.0);
    const auto corrector = make_mutual_corrector(order, 1.0);
    Random random(1);
    EXPECT_EQ(allocations_of([&] {
                bool started = false;
                for (int i = 0; i < kSamples; ++i) {
                  const RatePair pair{0.01 * i, {random.normal(), random.normal()}};
                  if (started) {
                    corrector->update(pair);
                  } else if (!calibrator.add(pair.t_s, pair.rate_dps, 0.0)) {
                    corrector->start(calibrator.result());
                    started = true;
                  }
                }
              }),
              0U)
        << order;
    EXPECT_GE(corrector->windows().completed, 70U);
  }
}

// The filters of all banks are made in start(), in memory that the constructor reserved; then
// follow windows, stops, one gyro alone, gaps and a jump.
TEST(Allocation, IsNotDoneByTheOptimalCorrector) {
  Calibrator calibrator(0, 20.0);
  const auto corrector = make_optimal_corrector({});
  Random random(1);
  EXPECT_EQ(allocations_of([&] {
              bool started = false;
              for (int i = 0; i < 2 * kSamples; ++i) {
                const bool moving = i / 1000 % 2 == 1;
                const double rate = moving ? 20.0 * std::sin(0.02 * i) : 0.0;
                const double jump = i > kSamples ? 1.0 : 0.0;
                const double gap_s = i > 5500 ? 30.0 : 0.0;
                const RatePair pair{
                    0.02 * i + gap_s,
                    {rate + jump + random.normal(0.01), rate + random.normal(0.01)}};
                if (started && i % 3000 < 200) {
                  corrector->update_alone(i % 2000 < 1000 ? 0 : 1, pair);
                } else if (started) {
                  corrector->update(pair);
                } else if (calibrator.add(pair.t_s, pair.rate_dps, 0.0)) {
                  corrector->calibrate(pair, 0.0);
                } else {
                  corrector->start(calibrator.result());
                  started = true;
                }
              }
            }),
            0U);
  EXPECT_GE(corrector->windows().completed, 30U);
  EXPECT_GE(corrector->condition().stops, 2U);
  EXPECT_GE(corrector->condition().disagreements, 1U);
}

// Hypotheses are split, merged, swapped and dropped, and the memory of their banks moves with them.
TEST(Allocation, IsNotDoneByTheReadings) {
  Readings readings({});
  const DriftMemory none;
  Random random(2);
  double stepped = 0.0;
  DriftMemory memory = none;
  EXPECT_EQ(allocations_of([&] {
              readings.begin({1e-3, 2e-3}, {0.1, -0.1}, {1e-6, 0.0, 4e-6});
              for (int i = 0; i < 300; ++i) {
                DriftMeasurement one(1);
                one.rows(0, kBias1) = 1.0;
                one.rows(0, kBias2) = -1.0;
                one.values(0) = 0.2 + random.normal(1e-3);
                one.noise(0, 0) = 1e-6;
                DriftMeasurement both(2);
                both.rows(0, kBias1) = both.rows(1, kBias2) = 1.0;
                both.noise *= 1e-6;
                both.values << 0.1 + random.normal(1e-3), -0.1 + random.normal(1e-3);
                SteadyWindow window;
                window.standing = both;
                window.turning = one;
                window.weight = {0.8, 0.2};
                window.level_dps = 0.8 * both.values(0) + 0.2 * both.values(1);
                window.level_variance = 1e-6;
                window.length_s = 2.0;
                window.log_turning = -0.5;
                switch (i % 10) {
                  case 0:
                    readings.split_step(random.normal(0.05), 1e-5, 0.4);
                    break;
                  case 1:
                    readings.learn_maybe_step(10.0, one, one, random.normal(0.05), 1e-5, 0.4);
                    break;
                  case 2:
                    readings.suspect(random.below(2));
                    break;
                  case 3:
                  case 4:
                  case 5:
                    readings.learn_steady(window);
                    break;
                  case 6:
                    readings.end_steady();
                    break;
                  case 7:
                    readings.set_temperature({20.0 + 0.1 * i, 20.0});
                    break;
                  case 8:
                    readings.predict(5.0);
                    readings.observe_at({20.0, 20.0});
                    readings.save(memory);
                    memory.white_density = {1e-6, 0.0, 4e-6};
                    memory.bias_covariance = {1e-6, 0.0, 4e-6};
                    memory.scale_difference_sigma = memory.skew_sigma_s = 0.01;
                    if (i == 288) readings.resume(memory, 10.0);
                    break;
                  default:
                    readings.learn(10.0, one);
                }
                stepped = std::max(stepped, readings.stepped(0));
                static_cast<void>(readings.estimate());
                static_cast<void>(readings.ambiguous());
              }
            }),
            0U);
  EXPECT_GT(stepped, 0.1) << "else nothing was split";
}

}  // namespace
}  // namespace vgyro::fusion
