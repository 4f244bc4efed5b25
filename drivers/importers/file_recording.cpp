// SPDX-License-Identifier: Apache-2.0
#include "drivers/importers/file_recording.hpp"

#include <fcntl.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <utility>

#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "drivers/files/descriptor.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/reader_process.hpp"
#include "drivers/importers/file_formats.hpp"
#include "drivers/program_folders.hpp"
#include "drivers/replay/registration.hpp"
#include "drivers/stream/stream_protocol.hpp"
#include "words/foreign.hpp"
#include "words/recording.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using stream::Header;
using stream::Hello;
using stream::Kind;

constexpr std::size_t kMaxSideCar = std::size_t{1} << 16;
constexpr std::int64_t kMinPairs = 2;

fs::path FileReaderProgram() {
  const std::optional<fs::path> program = FindBesideProgram("lib/plumb/plumb-file-reader");
  if (!program) throw IoError(say::foreign::ReaderMissing());
  return *program;
}

fs::path SideCarOf(const fs::path& file) {
  fs::path side_car = file;
  side_car += ".yaml";
  return side_car;
}

/// The last stamps of a stream.
struct Stamps {
  std::int64_t read_us = -1, given_us = -1;
};

class FileRecording : public ImportedRecording {
 public:
  FileRecording(fs::path file, const RecordingDefaults& defaults)
      : file_(std::move(file)),
        reader_(FileReaderProgram(),
                {file_.string(),
                 std::to_string(static_cast<std::int64_t>(1e6 * defaults.max_stamp_gap_s))}) {
    TakeHello(defaults);
  }
  [[nodiscard]] const StreamInfo& info() const override { return info_; }
  [[nodiscard]] const ImportedFacts& facts() const override { return facts_; }
  [[nodiscard]] std::optional<Frame> Next() override;

 private:
  [[noreturn]] void Fail(const Message& why) {
    finished_ = true;
    throw DataError(say::foreign::Damaged(file_.string(), why));
  }
  void Read(void* data, std::size_t size);
  Header ReadHeader(Kind& kind);
  void TakeHello(const RecordingDefaults& defaults);
  void TakeSideCar(const fs::path& side_car);
  void NoteClass(const std::string& side_car);
  void CheckUsable();
  cv::Mat ReadImage(Kind wanted, double& time_s, Stamps& last);

  const fs::path file_;
  ReaderProcess reader_;
  Hello hello_;
  ImportedFacts facts_;
  std::string class_by_;  ///< The name that the class was guessed by; empty: it was not.
  StreamInfo info_;
  std::optional<DepthRegistration> registration_;
  std::int64_t next_index_ = 0;
  Stamps last_color_, last_depth_;
  bool finished_ = false;
};

void FileRecording::Read(void* data, std::size_t size) {
  switch (reader_.Read(data, size)) {
    case ReaderProcess::Got::kAll:
      return;
    case ReaderProcess::Got::kEnd: {
      const ReaderProcess::End end = reader_.Reap();
      Fail(end.crashed ? say::foreign::ReaderCrashed(end.code)
                       : say::recording::ReaderEnded(end.code));
    }
    case ReaderProcess::Got::kSilence:
      Fail(say::foreign::ReaderSilent(static_cast<double>(kReaderPatience.count())));
  }
}

Header FileRecording::ReadHeader(Kind& kind) {
  Header header;
  Read(&header, sizeof header);
  const std::optional<Kind> read = stream::KindOf(header);
  if (!read || header.size > stream::kMaxRecordedHello) Fail(say::recording::ReaderVersion());
  kind = *read;
  if (kind == Kind::kError) {
    std::string text(static_cast<std::size_t>(header.size), ' ');
    Read(text.data(), text.size());
    Fail(ReaderErrorOf(text));
  }
  return header;
}

void FileRecording::TakeHello(const RecordingDefaults& defaults) {
  Kind kind{};
  std::string text(static_cast<std::size_t>(ReadHeader(kind).size), ' ');
  if (kind != Kind::kHello) Fail(say::recording::ReaderVersion());
  Read(text.data(), text.size());
  try {
    hello_ = stream::ParseHello(text, true);
    const nlohmann::ordered_json stated = hello_.recording;
    facts_.format = stated.at("format").get<std::string>();
    facts_.firmware = stated.at("firmware").get<std::string>();
    class_by_ = stated.at("class_by").get<std::string>();
    if (!stated.at("stereo_baseline_m").is_null())
      facts_.stereo_baseline_m = stated["stereo_baseline_m"].get<double>();
    facts_.color_images = stated.at("color_images").get<std::int64_t>();
    for (const auto& stamp_us : stated.at("depth_us"))
      facts_.depth_s.push_back(1e-6 * stamp_us.get<double>());
    info_.num_frames = stated.at("pairs").get<std::int64_t>();
    info_.warnings = MessagesFromJson(stated.at("warning_messages"),
                                      stated.at("warnings").get<std::vector<std::string>>());
  } catch (const DataError& error) {
    Fail(error.message());
  } catch (const nlohmann::json::exception&) {
    Fail(say::recording::ReaderVersion());
  }
  facts_.name = hello_.name;
  facts_.serial = hello_.serial;
  facts_.calibration = facts_.format;
  std::error_code error;
  const fs::path side_car = SideCarOf(file_);
  if (fs::exists(side_car, error)) TakeSideCar(side_car);
  NoteClass(side_car.filename().string());
  // A recorder that was killed leaves its last messages in a log beside the database.
  fs::path log = file_;
  log += "-wal";
  if (const auto bytes = fs::file_size(log, error);
      !error && bytes > 0 && facts_.format.ends_with(".db3"))
    info_.warnings.push_back(say::foreign::LogOfWrites(log.filename().string()));
  facts_.camera = hello_.camera;
  info_.room_markers = defaults.room_markers;
  TakeOver(hello_.camera, info_);
  info_.dictionary_assumed = !hello_.camera.room_markers.dictionary;
  info_.marker_length_assumed = !hello_.camera.room_markers.length_m;
  if (info_.dictionary_assumed || info_.marker_length_assumed) {
    info_.warnings.push_back(
        say::recording::MarkersAssumed(info_.room_markers.dictionary, info_.room_markers.length_m));
  }
  if (const std::optional<DepthCamera>& depth = hello_.camera.depth_camera)
    registration_.emplace(depth->intrinsics, hello_.camera.color, depth->T_color_depth);
}

/// The file beside the recording states cameras and markers; the class that the recording's device
/// has remains, if the file does not state one.
void FileRecording::TakeSideCar(const fs::path& side_car) {
  CameraFile stated = ParseCameraFile(ReadTextFile(side_car, kMaxSideCar), side_car.string());
  if (stated.depth_sensor)
    class_by_.clear();
  else
    stated.depth_sensor = hello_.camera.depth_sensor;
  hello_.camera = std::move(stated);
  facts_.calibration = side_car.filename().string();
  info_.warnings.push_back(say::foreign::SideCar(facts_.calibration));
}

void FileRecording::NoteClass(const std::string& side_car) {
  const std::optional<DepthSensor>& sensor = hello_.camera.depth_sensor;
  if (!sensor)
    info_.warnings.push_back(
        say::foreign::ClassAssumed(std::string(Name(DepthSensor::kStructuredLight)), side_car));
  else if (!class_by_.empty())
    info_.warnings.push_back(
        say::foreign::ClassGuessed(std::string(Name(*sensor)), class_by_, side_car));
}

void FileRecording::CheckUsable() {
  const auto refuse = [this](const Message& why) {
    finished_ = true;
    throw DataError(why);
  };
  const std::string side_car = SideCarOf(file_).filename().string();
  if (*info_.num_frames < kMinPairs)
    refuse(say::foreign::FewPairs(file_.string(), *info_.num_frames, facts_.color_images,
                                  std::ssize(facts_.depth_s), kMinPairs));
  if (!hello_.camera.depth_scale) refuse(say::foreign::StateUnit(file_.string(), side_car));
  if (hello_.camera.depth_camera_unknown)
    refuse(say::foreign::StateDepthCamera(file_.string(), side_car));
}

cv::Mat FileRecording::ReadImage(Kind wanted, double& time_s, Stamps& last) {
  Kind kind{};
  const Header header = ReadHeader(kind);
  if (kind == Kind::kEnd && wanted == Kind::kColor) return {};
  if (kind != wanted) Fail(say::recording::ReaderVersion());
  // Nanoseconds may rise within one microsecond.
  if (header.stamp_us < last.read_us) Fail(say::recording::OniStamps());
  last.read_us = header.stamp_us;
  last.given_us = std::max(header.stamp_us, last.given_us + 1);
  time_s = 1e-6 * static_cast<double>(last.given_us);
  cv::Mat image;
  try {
    image = stream::ImageFor(kind, header.size, hello_);
  } catch (const DataError& error) {
    Fail(error.message());
  }
  Read(image.data, static_cast<std::size_t>(header.size));
  return image;
}

std::optional<Frame> FileRecording::Next() {
  if (finished_) return std::nullopt;
  if (next_index_ == 0) CheckUsable();
  Frame frame;
  frame.color_rgb = ReadImage(Kind::kColor, frame.color_time_s, last_color_);
  if (frame.color_rgb.empty()) {
    finished_ = true;
    return std::nullopt;
  }
  const cv::Mat units = ReadImage(Kind::kDepth, frame.depth_time_s, last_depth_);
  frame.index = next_index_++;
  frame.depth_m = DepthInMetres(units, *hello_.camera.depth_scale);
  if (registration_) frame.depth_m = registration_->Register(frame.depth_m);
  return frame;
}

}  // namespace

std::unique_ptr<ImportedRecording> OpenFileRecording(const fs::path& file,
                                                     const RecordingDefaults& defaults) {
  return std::make_unique<FileRecording>(fs::absolute(file), defaults);
}

bool IsFileRecording(const fs::path& file) {
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return false;
  const Descriptor opened = OpenForReading(file);
  std::array<std::uint8_t, kFirstBytes> first{};
  if (opened.get() < 0) return false;
  const ssize_t got = ReadAllAt(opened.get(), 0, std::as_writable_bytes(std::span(first)));
  return got > 0 && FormatOf(std::span(first).first(static_cast<std::size_t>(got)));
}

}  // namespace plumb
