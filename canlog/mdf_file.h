#pragma once

// The blocks of an MDF 4 file (ASAM MDF, .mf4), and the unpacked data of lists of blocks. The
// meaning of records is not known here.

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "canlog/byte_source.h"

namespace vgyro::canlog {

/// One block: its links, and the beginning of its data.
struct MdfBlock {
  std::string kind;  ///< "##DG"
  std::uint64_t at = 0;
  std::uint64_t data_at = 0;
  std::uint64_t data_bytes = 0;  ///< the size that the block states
  std::vector<std::uint64_t> links;
  std::string data;  ///< as much of the data as was requested
  /// Zero if the block has no such link.
  [[nodiscard]] std::uint64_t link(std::size_t index) const {
    return index < links.size() ? links[index] : 0;
  }
};

class MdfFile {
 public:
  /// Reads the file's head. Error if it is invalid, or of an unsupported version.
  static Expected<std::shared_ptr<MdfFile>> open(std::unique_ptr<ByteSource> bytes);

  /// Reads a block of the given `kind`, or of any kind if that is empty. Error if there is no such
  /// block, and after very many blocks, which ends circular lists.
  Expected<MdfBlock> block(std::uint64_t at, std::string_view kind, std::size_t data_bytes);
  /// The text in a block; empty if there is none.
  std::string text(std::uint64_t at);
  /// Reads fewer bytes only if the file ends.
  Expected<std::size_t> read(std::uint64_t at, char* to, std::size_t size);

  /// The writer has not completed the entries that it writes at the end.
  [[nodiscard]] bool is_unfinished() const { return unfinished_ != 0; }
  /// Counts of records are missing or wrong.
  [[nodiscard]] bool lacks_counts() const { return (unfinished_ & 1U) != 0; }
  /// The last data block extends to the end of the file.
  [[nodiscard]] bool lacks_data_size() const { return (unfinished_ & 4U) != 0; }
  [[nodiscard]] const std::string& name() const { return bytes_->name(); }
  [[nodiscard]] ByteSource& bytes() { return *bytes_; }
  [[nodiscard]] const ByteSource& bytes() const { return *bytes_; }
  [[nodiscard]] Error damage(std::uint64_t at, std::string_view what) const;

 private:
  explicit MdfFile(std::unique_ptr<ByteSource> bytes) : bytes_(std::move(bytes)) {}

  std::unique_ptr<ByteSource> bytes_;
  std::uint64_t at_ = 0;  ///< position of bytes_
  unsigned unfinished_ = 0;
  std::size_t blocks_read_ = 0;
};

/// The data behind a link as one run of bytes: a block, packed or not, or a list of blocks.
class MdfData final : public ByteSource {
 public:
  MdfData(std::shared_ptr<MdfFile> file, std::uint64_t link)
      : file_(std::move(file)), list_(link) {}

  Expected<std::size_t> read(char* to, std::size_t size) override;
  [[nodiscard]] const std::string& name() const override { return file_->name(); }
  [[nodiscard]] std::uint64_t bytes_read() const override { return file_->bytes().bytes_read(); }
  [[nodiscard]] std::uint64_t bytes_total() const override { return file_->bytes().bytes_total(); }
  void before_wait(std::function<void()> callback) override {
    file_->bytes().before_wait(std::move(callback));
  }
  /// The file ended before the data.
  [[nodiscard]] bool is_cut_off() const { return cut_off_; }

 private:
  Expected<bool> next_part();
  Expected<void> open_part(const MdfBlock& block);
  Expected<void> unpack(const MdfBlock& block);

  std::shared_ptr<MdfFile> file_;
  std::uint64_t list_;  ///< the next block or list; 0: none
  std::vector<std::uint64_t> parts_;
  std::size_t part_ = 0;
  std::uint64_t at_ = 0;    ///< position in the file, in the part being read
  std::uint64_t left_ = 0;  ///< bytes left of that part
  std::string plain_;       ///< a packed part, all of it unpacked
  std::size_t plain_at_ = 0;
  bool cut_off_ = false;
};

}  // namespace vgyro::canlog
