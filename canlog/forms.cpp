#include "canlog/forms.h"

#include <array>
#include <cstring>

#include "canlog/asc.h"
#include "canlog/blf.h"
#include "canlog/candump.h"
#include "canlog/candump_screen.h"
#include "canlog/csv.h"
#include "canlog/mdf.h"
#include "canlog/pcap.h"
#include "canlog/pcapng.h"
#include "canlog/text_line.h"
#include "canlog/trc.h"

namespace vgyro::canlog {

namespace {

using namespace std::string_view_literals;
constexpr std::int64_t kSecond_ns = 1'000'000'000;
using Opened = Expected<std::unique_ptr<LogReader>>;

template <class Reader>
Opened open_lines(std::unique_ptr<ByteSource> bytes) {
  return std::make_unique<Reader>(std::move(bytes));
}
Opened open_candump(std::unique_ptr<ByteSource> bytes) {
  return std::make_unique<CandumpReader>(std::make_unique<LogSource>(std::move(bytes)));
}

// "(1700000000.123456) can0 123#…", whatever follows the identifier.
bool is_candump_line(std::string_view line) {
  if (line.starts_with("DROPCOUNT:")) return true;
  if (!line.starts_with('(')) return false;
  Words words(line.substr(1));
  std::string_view stamp = words.next();
  if (!stamp.ends_with(')')) return false;
  stamp.remove_suffix(1);
  if (stamp.find('.') == stamp.npos || !decimal_time(stamp, kSecond_ns)) return false;
  words.next();
  return words.next().find('#') != std::string_view::npos;
}

constexpr std::array kForms{
    Form{"what `candump -L` prints and `candump -l` writes", nullptr, is_candump_line,
         open_candump},
    Form{"candump's screen text with stamps", nullptr, is_candump_screen_line, open_candump_screen},
    Form{"Vector ASC", nullptr, is_asc_line, open_lines<AscReader>},
    Form{"Vector BLF", is_blf, nullptr, BlfReader::open},
    Form{"pcap of CAN", is_pcap, nullptr, PcapReader::open},
    Form{"MDF 4 with CAN frames (MF4)", is_mdf, nullptr, MdfReader::open},
    Form{"pcapng of CAN", is_pcapng, nullptr, PcapngReader::open},
    Form{"PEAK TRC", nullptr, is_trc_line, open_lines<TrcReader>},
    Form{"python-can's CSV", nullptr, is_python_can_csv_line, open_lines<PythonCanCsvReader>},
    Form{"SavvyCAN's CSV", nullptr, is_savvycan_csv_line, open_lines<SavvyCanCsvReader>},
    Form{"", nullptr, is_stampless_screen_line, refuse_stampless_screen},
};

bool starts(std::string_view head, std::string_view magic, std::size_t at = 0) {
  return head.size() >= at + magic.size() && head.substr(at, magic.size()) == magic;
}

// The mark comes late, so it counts only without a line before it: otherwise the form would depend
// on the pieces in which the log arrives.
bool is_tar(std::string_view head) {
  constexpr std::size_t kMarkAt = 257;
  return starts(head, "ustar", kMarkAt) && head.find('\n') > kMarkAt;
}

constexpr auto kUnpackOutside = "unpack it, and name the logs in it"sv;

constexpr std::array kForeign{
    ForeignForm{"is a ROS 1 bag", [](std::string_view h) { return starts(h, "#ROSBAG"); },
                "CAN frames of a bag come out with a few lines of the rosbags package for Python: "
                "can_msgs/Frame → candump lines"},
    ForeignForm{"is an MCAP recording",
                [](std::string_view h) { return starts(h, "\x89MCAP0\r\n"); },
                "CAN frames in it come out with the mcap or rosbags package for Python: "
                "can_msgs/Frame → candump lines"},
    ForeignForm{"is an SQLite database, as ROS 2 bags and python-can's sqlite logs are",
                [](std::string_view h) { return starts(h, "SQLite format 3\0"sv); },
                "`can_logconvert FILE.db OUT.log` of python-can converts its own; for a bag the "
                "rosbags package for Python"},
    ForeignForm{"is a packed or encrypted log of a CANedge (MFC, MFE, MFM)",
                [](std::string_view h) { return starts(h, "Generic File"); },
                "its maker's mdf2finalized makes an MF4 file of it"},
    ForeignForm{"is an HDF5 file, as MATLAB 7.3 writes too",
                [](std::string_view h) { return starts(h, "\x89HDF\r\n\x1A\n"sv); },
                "export the frames, not decoded signals, as ASC, BLF or CSV"},
    ForeignForm{"is a MATLAB file",
                [](std::string_view h) { return starts(h, "MATLAB 5.0 MAT-file"); },
                "export the frames, not decoded signals, as ASC, BLF or CSV"},
    ForeignForm{"is a ZIP archive", [](std::string_view h) { return starts(h, "PK\x03\x04"); },
                kUnpackOutside},
    ForeignForm{"is a 7-Zip archive",
                [](std::string_view h) { return starts(h, "7z\xBC\xAF\x27\x1C"sv); },
                kUnpackOutside},
    ForeignForm{"is a RAR archive", [](std::string_view h) { return starts(h, "Rar!\x1A\x07"sv); },
                kUnpackOutside},
    ForeignForm{"is a tar archive", is_tar, "`tar -xOf FILE NAME | vgyro … -` reads one log of it"},
    ForeignForm{"is a Parquet table", [](std::string_view h) { return starts(h, "PAR1"); },
                "a table holds decoded values; the log of frames that it came from is needed"},
    ForeignForm{"is a PDF document", [](std::string_view h) { return starts(h, "%PDF-"); },
                "a log of frames is needed"},
    ForeignForm{
        "is UTF-16 text, as PowerShell's > writes it",
        [](std::string_view h) { return starts(h, "\xFF\xFE"sv) || starts(h, "\xFE\xFF"sv); },
        "`iconv -f UTF-16 -t UTF-8 FILE | vgyro … -` makes a log of it"},
};

}  // namespace

std::span<const Form> forms() {
  return kForms;
}

std::span<const ForeignForm> foreign_forms() {
  return kForeign;
}

}  // namespace vgyro::canlog
