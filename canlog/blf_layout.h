#pragma once

// Offsets and constants of BLF files; all numbers are little-endian. Derived from files written by
// Vector's tools, and from what python-can and Wireshark read and write.

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace vgyro::canlog::blf {

inline constexpr std::string_view kFileMark = "LOGG";
inline constexpr std::string_view kObjectMark = "LOBJ";

/// The file's head.
namespace file {
inline constexpr std::size_t kHeadBytes = 4;    ///< u32
inline constexpr std::size_t kProgram = 8;      ///< u8: program that wrote the file; 0 unknown
inline constexpr std::size_t kVersion = 12;     ///< four u8, of the format
inline constexpr std::size_t kFileBytes = 16;   ///< u64
inline constexpr std::size_t kPlainBytes = 24;  ///< u64: size with everything unpacked, heads
                                                ///< included
inline constexpr std::size_t kObjects = 32;     ///< u32
inline constexpr std::size_t kBegin = 40;       ///< date of the measurement's beginning
inline constexpr std::size_t kEnd = 56;         ///< date of its end
inline constexpr std::size_t kBytes = 144;      ///< size of the head as written
/// A shorter or longer head is invalid.
inline constexpr std::size_t kBytesMin = 72;
inline constexpr std::size_t kBytesMax = 65'536;
}  // namespace file

/// A date: u16 year, month, day of the week, day, hour, minute, second, millisecond; zero: none.
inline constexpr std::size_t kDateWords = 8;

/// The head of every object.
namespace object {
inline constexpr std::size_t kHeadBytes = 4;  ///< u16: where the object's own fields begin
inline constexpr std::size_t kVersion = 6;    ///< u16
inline constexpr std::size_t kBytes = 8;      ///< u32, including the head, without padding
inline constexpr std::size_t kType = 12;      ///< u32
inline constexpr std::size_t kBaseBytes = 16;
/// In objects that are events, in every version of the head.
inline constexpr std::size_t kStampUnit = 16;  ///< u32
inline constexpr std::size_t kStamp = 24;      ///< u64 since the measurement's beginning
inline constexpr std::size_t kEventBytes = 32;
inline constexpr std::uint32_t kTenMicros = 1;
inline constexpr std::uint32_t kNanos = 2;
}  // namespace object

/// An object is followed by as many bytes as its size exceeds a multiple of this (which does not
/// align the next one); some writers pad to the boundary, some not at all.
inline constexpr std::size_t kPaddingOf = 4;

enum Type : std::uint32_t {
  kCanMessage = 1,
  kCanError = 2,
  kContainer = 10,
  kCanErrorExt = 73,
  kCanMessage2 = 86,
  kCanFdMessage = 100,
  kCanFdMessage64 = 101,
  kCanFdError64 = 104,
  kRestorePoints = 115  ///< an index into the file, without content
};

/// Offsets after the object's head.
namespace container {
inline constexpr std::size_t kPacking = 0;     ///< u16
inline constexpr std::size_t kPlainBytes = 8;  ///< u32
inline constexpr std::size_t kHeadBytes = 16;
inline constexpr std::uint16_t kStored = 0;
inline constexpr std::uint16_t kDeflated = 2;
}  // namespace container

/// In kCanMessage, kCanMessage2, kCanFdMessage. Error objects have the channel in the same place.
namespace message {
inline constexpr std::size_t kChannel = 0;  ///< u16
inline constexpr std::size_t kFlags = 2;    ///< u8
inline constexpr std::size_t kDlc = 3;      ///< u8
inline constexpr std::size_t kId = 4;       ///< u32
inline constexpr std::size_t kData = 8;     ///< 8 bytes
inline constexpr std::size_t kBytes = 16;
inline constexpr std::uint8_t kDirection = 0x0F;
inline constexpr std::uint8_t kRemote = 0x80;
}  // namespace message

namespace fd {
inline constexpr std::size_t kFdFlags = 13;  ///< u8
inline constexpr std::size_t kLength = 14;   ///< u8: valid bytes
inline constexpr std::size_t kData = 20;     ///< 64 bytes
inline constexpr std::size_t kBytes = 84;
inline constexpr std::uint8_t kFormat = 1;
inline constexpr std::uint8_t kRateSwitch = 2;
inline constexpr std::uint8_t kErrorState = 4;
}  // namespace fd

namespace fd64 {
inline constexpr std::size_t kChannel = 0;     ///< u8
inline constexpr std::size_t kDlc = 1;         ///< u8
inline constexpr std::size_t kLength = 2;      ///< u8: valid bytes
inline constexpr std::size_t kId = 4;          ///< u32
inline constexpr std::size_t kFlags = 12;      ///< u32
inline constexpr std::size_t kDirection = 34;  ///< u8
inline constexpr std::size_t kMoreAt = 35;     ///< u8: where other data begin in the object
inline constexpr std::size_t kData = 40;       ///< as many bytes as the object has room for
inline constexpr std::uint32_t kRemote = 1U << 4U;
inline constexpr std::uint32_t kFormat = 1U << 12U;
inline constexpr std::uint32_t kRateSwitch = 1U << 13U;
inline constexpr std::uint32_t kErrorState = 1U << 14U;
}  // namespace fd64

/// Size of the error objects that hold more than the channel; their contents are not used.
namespace error_ext {
inline constexpr std::size_t kBytes = 32;
}

/// Values of a direction.
inline constexpr std::uint8_t kReceived = 0;
inline constexpr std::uint8_t kTransmitted = 1;
inline constexpr std::uint8_t kTransmitRequest = 2;  ///< no frame on the bus yet

inline constexpr std::uint32_t kExtendedId = 1U << 31U;

}  // namespace vgyro::canlog::blf
