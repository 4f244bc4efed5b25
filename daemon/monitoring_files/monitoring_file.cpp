// SPDX-License-Identifier: Apache-2.0
#include "daemon/monitoring_files/monitoring_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <ctime>
#include <utility>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <zlib.h>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "words/monitoring.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little);

constexpr std::string_view kMonitoringMagic = "PLUMBMON";
constexpr std::uint32_t kMonitoringVersion = 1;
constexpr std::size_t kBeforeBlocks = kMonitoringMagic.size() + sizeof(kMonitoringVersion);
constexpr std::uint32_t kTextBlock = 1, kFramesBlock = 2;
constexpr std::size_t kBlockHead = 8, kBlockSum = 4;
constexpr std::size_t kMostPayload = std::size_t{64} << 10;
constexpr double kMostValue = 1e6;  ///< Metres, radians, whatever: what is larger was not measured.
constexpr double kOfInterval = 1e-6, kOfVisible = 1e-4, kOfResidual = 1e-3;
constexpr std::uint64_t kRoomOfASecond = std::uint64_t{64} << 10;

/// One frame in the file. Absent numbers are zeros whose flag is not set.
struct StoredFrame {
  double time_s = 0;
  std::array<std::array<float, 6>, 2> value{};        ///< Since zero, against the reference.
  std::array<std::array<std::uint16_t, 6>, 2> u95{};  ///< In kOfInterval, rounded up.
  float breathing_m = 0, support_rise_m = 0, drift = 1;
  std::uint16_t visible = 0, residual = 0;
  std::uint8_t sensor = 0, sensors_used = 0, state = 0, advice = 0, reason = 0, markers = 0,
               flags = 0, unused = 0;
};
static_assert(sizeof(StoredFrame) == 104 && std::is_trivially_copyable_v<StoredFrame>);

enum FrameFlag : std::uint8_t {
  kHasSinceZero = 1,
  kHasAgainstReference = 2,
  kHasBreathing = 4,
  kHasSupportRise = 8,
  kCouchMoved = 16,
  kAllFlags = 31,
};

std::uint16_t Rounded(double value, double unit) {
  return static_cast<std::uint16_t>(std::clamp(std::ceil(value / unit - 1e-9), 0.0, 65535.0));
}

std::uint8_t Counted(double count) {
  return static_cast<std::uint8_t>(std::clamp(count, 0.0, 255.0));
}

StoredFrame FrameOf(const MonitorLine& line) {
  StoredFrame frame{.time_s = line.time_s,
                    .drift = static_cast<float>(line.drift),
                    .visible = Rounded(line.visible, kOfVisible),
                    .residual = Rounded(line.residual, kOfResidual),
                    .sensor = Counted(static_cast<double>(line.sensor)),
                    .sensors_used = Counted(line.sensors_used),
                    .state = static_cast<std::uint8_t>(line.state),
                    .advice = static_cast<std::uint8_t>(line.advice),
                    .reason = static_cast<std::uint8_t>(line.reason),
                    .markers = Counted(line.markers_seen)};
  const auto put = [&frame](std::size_t which, const std::optional<LiveNumbers>& numbers,
                            FrameFlag flag) {
    if (!numbers) return;
    frame.flags |= flag;
    for (std::size_t i = 0; i < 6; ++i) {
      frame.value[which][i] = static_cast<float>(numbers->value[static_cast<Eigen::Index>(i)]);
      frame.u95[which][i] = Rounded(numbers->u95[static_cast<Eigen::Index>(i)], kOfInterval);
    }
  };
  put(0, line.since_zero, kHasSinceZero);
  put(1, line.against_reference, kHasAgainstReference);
  if (line.breathing_m) {
    frame.flags |= kHasBreathing;
    frame.breathing_m = static_cast<float>(*line.breathing_m);
  }
  if (line.support_rise_m) {
    frame.flags |= kHasSupportRise;
    frame.support_rise_m = static_cast<float>(*line.support_rise_m);
  }
  if (line.couch_moved) frame.flags |= kCouchMoved;
  return frame;
}

/// Nothing if it holds what no writer wrote.
std::optional<MonitorLine> LineOf(const StoredFrame& frame) {
  bool good = frame.state <= static_cast<std::uint8_t>(MonitorState::kMovedSensor) &&
              frame.advice <= static_cast<std::uint8_t>(LiveAdvice::kUnknown) &&
              frame.reason <= static_cast<std::uint8_t>(BlindReason::kNoZero) &&
              frame.flags <= kAllFlags && frame.unused == 0 && std::isfinite(frame.time_s) &&
              std::abs(frame.time_s) < 1e12;
  const auto check = [&good](double value) {
    good = good && std::isfinite(value) && std::abs(value) <= kMostValue;
    return value;
  };
  const auto take = [&](std::size_t which, FrameFlag flag) -> std::optional<LiveNumbers> {
    LiveNumbers numbers;
    for (std::size_t i = 0; i < 6; ++i) {
      numbers.value[static_cast<Eigen::Index>(i)] = check(frame.value[which][i]);
      numbers.u95[static_cast<Eigen::Index>(i)] = kOfInterval * frame.u95[which][i];
    }
    return (frame.flags & flag) != 0 ? std::optional(numbers) : std::nullopt;
  };
  const auto one = [&](double value, FrameFlag flag) {
    check(value);
    return (frame.flags & flag) != 0 ? std::optional(value) : std::nullopt;
  };
  const MonitorLine line{.time_s = frame.time_s,
                         .sensor = frame.sensor,
                         .sensors_used = frame.sensors_used,
                         .state = static_cast<MonitorState>(frame.state),
                         .advice = static_cast<LiveAdvice>(frame.advice),
                         .since_zero = take(0, kHasSinceZero),
                         .against_reference = take(1, kHasAgainstReference),
                         .breathing_m = one(frame.breathing_m, kHasBreathing),
                         .support_rise_m = one(frame.support_rise_m, kHasSupportRise),
                         .visible = kOfVisible * frame.visible,
                         .residual = kOfResidual * frame.residual,
                         .drift = check(frame.drift),
                         .markers_seen = frame.markers,
                         .reason = static_cast<BlindReason>(frame.reason),
                         .couch_moved = (frame.flags & kCouchMoved) != 0};
  return good ? std::optional(line) : std::nullopt;
}

template <typename Value>
void Append(std::string& text, const Value& value) {
  text.append(reinterpret_cast<const char*>(&value), sizeof(value));
}

template <typename Value>
Value TakeAt(std::string_view text, std::size_t at) {
  Value value;
  std::memcpy(&value, text.data() + at, sizeof(value));
  return value;
}

std::uint32_t SumOf(std::string_view text) {
  return static_cast<std::uint32_t>(
      ::crc32(0, reinterpret_cast<const Bytef*>(text.data()), static_cast<uInt>(text.size())));
}

/// The blocks of a file, one after the other.
class BlockReader {
 public:
  BlockReader(std::string_view bytes, const fs::path& file) : bytes_(bytes), file_(file) {
    if (!bytes.starts_with(kMonitoringMagic) || bytes.size() < kBeforeBlocks)
      throw DataError(say::monitoring::NoRecordFile(file.string()));
    const auto version = TakeAt<std::uint32_t>(bytes, kMonitoringMagic.size());
    if (version != kMonitoringVersion)
      throw DataError(
          say::monitoring::RecordOtherVersion(file.string(), version, kMonitoringVersion));
  }

  struct Block {
    std::uint32_t kind = 0;
    std::string_view payload;
  };

  /// Nothing at the end. @throws DataError before the last block
  std::optional<Block> Next() {
    const std::string_view rest = bytes_.substr(at_);
    if (rest.empty()) return std::nullopt;
    // A power cut may leave a length of file that was never written.
    if (rest.find_first_not_of('\0') == std::string_view::npos || rest.size() < kBlockHead)
      return CutOff();
    const auto kind = TakeAt<std::uint32_t>(rest, 0);
    const std::size_t length = TakeAt<std::uint32_t>(rest, 4);
    if ((kind != kTextBlock && kind != kFramesBlock) || length > kMostPayload) Damaged();
    const std::size_t whole = kBlockHead + length + kBlockSum;
    if (rest.size() < whole) return CutOff();
    const bool is_last = rest.find_first_not_of('\0', whole) == std::string_view::npos;
    if (TakeAt<std::uint32_t>(rest, kBlockHead + length) !=
        SumOf(rest.substr(0, kBlockHead + length))) {
      if (!is_last) Damaged();
      return CutOff();
    }
    at_ += whole;
    return Block{.kind = kind, .payload = rest.substr(kBlockHead, length)};
  }

  [[nodiscard]] bool is_cut_off() const { return is_cut_off_; }
  [[noreturn]] void Damaged() const {
    throw DataError(say::monitoring::RecordDamaged(file_.string()));
  }

 private:
  std::optional<Block> CutOff() {
    is_cut_off_ = true;
    at_ = bytes_.size();
    return std::nullopt;
  }

  std::string_view bytes_;
  const fs::path& file_;
  std::size_t at_ = kBeforeBlocks;
  bool is_cut_off_ = false;
};

nlohmann::json TextIn(const BlockReader& reader, const std::optional<BlockReader::Block>& block) {
  if (!block || block->kind != kTextBlock) reader.Damaged();
  nlohmann::json json = ParseBoundedJsonOrNothing<nlohmann::json>(block->payload);
  if (!json.is_object()) reader.Damaged();
  return json;
}

}  // namespace

std::string MonitoringFileName(int number) { return fmt::format("{:02}.plm", number); }

std::string MonitoringTime() {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
}

MonitoringFileWriter::MonitoringFileWriter(fs::path file, const nlohmann::json& head)
    : path_(std::move(file)), file_([this] {
        const fs::path folder = path_.parent_path();
        if (::mkdir(folder.c_str(), 0750) != 0 && errno != EEXIST)
          throw IoError(DescribeWriteError(folder, errno));
        const int fd = ::open(
            path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_APPEND | O_NOFOLLOW, 0640);
        if (fd < 0) throw IoError(DescribeWriteError(path_, errno));
        return fd;
      }()) {
  std::string begin(kMonitoringMagic);
  Append(begin, kMonitoringVersion);
  WriteAll(file_, begin, path_);
  bytes_ = begin.size();
  AddEvent(head);
  Sync();
  SyncToDisk(path_.parent_path());
  SyncToDisk(path_.parent_path().parent_path());
}

void MonitoringFileWriter::AddFrames(std::span<const MonitorLine> lines) {
  constexpr std::size_t kOfBlock = kMostPayload / sizeof(StoredFrame);
  for (; !lines.empty(); lines = lines.subspan(std::min(kOfBlock, lines.size()))) {
    std::string payload;
    for (const MonitorLine& line : lines.first(std::min(kOfBlock, lines.size())))
      Append(payload, FrameOf(line));
    AddBlock(kFramesBlock, payload);
  }
}

void MonitoringFileWriter::AddEvent(const nlohmann::json& event) {
  AddBlock(kTextBlock, event.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
}

void MonitoringFileWriter::Sync() {
  if (::fdatasync(file_.get()) != 0) throw IoError(DescribeWriteError(path_, errno));
}

bool MonitoringFileWriter::HasRoom() const {
  return bytes_ + kRoomOfASecond <= kMostMonitoringBytes;
}

void MonitoringFileWriter::AddBlock(std::uint32_t kind, std::string_view payload) {
  if (payload.size() > kMostPayload) throw IoError(DescribeWriteError(path_, EFBIG));
  std::string block;
  Append(block, kind);
  Append(block, static_cast<std::uint32_t>(payload.size()));
  block += payload;
  Append(block, SumOf(block));
  WriteAll(file_, block, path_);
  bytes_ += block.size();
}

StoredMonitoring ReadMonitoringFile(const fs::path& file) {
  return ParseMonitoring(ReadTextFile(file, kMostMonitoringBytes), file);
}

StoredMonitoring ParseMonitoring(std::string_view bytes, const fs::path& file) {
  BlockReader reader(bytes, file);
  StoredMonitoring stored;
  stored.head = TextIn(reader, reader.Next());
  while (const std::optional<BlockReader::Block> block = reader.Next()) {
    if (block->kind == kTextBlock) {
      stored.events.push_back(TextIn(reader, block));
      continue;
    }
    if (block->payload.size() % sizeof(StoredFrame) != 0) reader.Damaged();
    for (std::size_t at = 0; at < block->payload.size(); at += sizeof(StoredFrame)) {
      const std::optional<MonitorLine> line = LineOf(TakeAt<StoredFrame>(block->payload, at));
      if (!line) reader.Damaged();
      stored.record.lines.push_back(*line);
    }
  }
  stored.is_cut_off = reader.is_cut_off();
  const auto judges = stored.head.find("judges");
  stored.record.has_reference =
      judges != stored.head.end() && judges->is_string() && *judges == "against_reference";
  return stored;
}

nlohmann::json ReadMonitoringHead(const fs::path& file) {
  const Descriptor opened(::open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY));
  std::string begin(kBeforeBlocks + kBlockHead + kMostPayload + kBlockSum, '\0');
  struct stat status {};
  const ssize_t got =
      opened.get() < 0 || ::fstat(opened.get(), &status) != 0 || !S_ISREG(status.st_mode)
          ? -1
          : ReadAllAt(opened.get(), 0, std::as_writable_bytes(std::span(begin)));
  if (got < 0) throw DataError(say::monitoring::NoRecordFile(file.string()));
  begin.resize(static_cast<std::size_t>(got));
  BlockReader reader(begin, file);
  return TextIn(reader, reader.Next());
}

std::vector<int> MonitoringFilesOf(const fs::path& scan) {
  std::vector<int> numbers;
  std::error_code ignored;
  for (int number = 1; number <= kMostMonitoringFiles; ++number) {
    if (fs::is_regular_file(scan / kMonitoringFolder / MonitoringFileName(number), ignored))
      numbers.push_back(number);
  }
  return numbers;
}

}  // namespace plumb
