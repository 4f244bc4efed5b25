// SPDX-License-Identifier: Apache-2.0
// .oni recordings: written through OpenNI2's recorder, read through its player in the child
// process.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include <fstream>
#include <random>
#include <thread>

#include <fmt/format.h>
#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/openni/oni_file.hpp"
#include "drivers/openni/oni_recorder.hpp"
#include "drivers/openni/oni_recording.hpp"
#include "drivers/replay/tum_writer.hpp"
#include "drivers/simulator/openni/oni_writer.hpp"
#include "drivers/simulator/suites/suite_plan.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/openni/virtual_rig.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::MessageOf;
using testing::TempFolder;
using testing::VirtualRig;

constexpr int kFrames = 8;

std::unique_ptr<SimulatedSource> Source() {
  SimulateOptions simulate;
  simulate.frames = kFrames;
  simulate.rate_hz = 30.0;
  simulate.width = 320;
  simulate.height = 240;
  return simulated::MakeSource(simulated::PlanSuite(simulate), 0);
}

/// One recording for all tests, written once.
const fs::path& Recording() {
  static const TempFolder folder;
  static const fs::path file = [] {
    WriteOni(folder / "sweep.oni", *Source());
    return folder / "sweep.oni";
  }();
  return file;
}

std::vector<std::uint8_t> Bytes() { return ReadWholeFile(Recording(), std::size_t{1} << 30); }

std::vector<Frame> ReadAll(FrameSource& recording) {
  std::vector<Frame> frames;
  while (auto frame = recording.Next()) frames.push_back(std::move(*frame));
  return frames;
}

TEST(OniTest, ComesBackAsItWasWritten) {
  const auto source = Source();
  const auto recording = OpenOniRecording(Recording());
  EXPECT_EQ(recording->info().intrinsics, source->info().intrinsics);
  EXPECT_EQ(recording->info().room_markers.dictionary, source->info().room_markers.dictionary);
  EXPECT_EQ(recording->info().room_markers.reference, source->info().room_markers.reference);
  EXPECT_EQ(recording->info().num_frames, kFrames);
  EXPECT_TRUE(recording->info().warnings.empty());
  const std::vector<Frame> frames = ReadAll(*recording);
  ASSERT_EQ(frames.size(), static_cast<std::size_t>(kFrames));
  for (const Frame& frame : frames) {
    const Frame truth = source->Next().value();
    EXPECT_EQ(frame.index, truth.index);
    EXPECT_NEAR(frame.color_time_s, truth.color_time_s, 2e-6);
    EXPECT_NEAR(frame.depth_time_s, truth.depth_time_s, 2e-6);
    EXPECT_EQ(cv::norm(frame.color_rgb, truth.color_rgb, cv::NORM_INF), 0.0);
    EXPECT_LE(cv::norm(frame.depth_m, truth.depth_m, cv::NORM_INF), 0.00051);
  }
}

TEST(OniTest, EndsAtItsEndRecord) {
  const auto found = SummariseOniFile(Recording());
  ASSERT_TRUE(found);
  EXPECT_EQ(found->end, fs::file_size(Recording()));
  EXPECT_EQ(found->color_us.size(), static_cast<std::size_t>(kFrames));
  EXPECT_EQ(found->depth_us.size(), static_cast<std::size_t>(kFrames));
}

TEST(OniFileTest, TellsWhenTheDataOfBothStreamsBegin) {
  EXPECT_TRUE(HasOniDataBegun(Recording(), 2));
  EXPECT_FALSE(HasOniDataBegun(Recording(), 3));
  const TempFolder folder;
  const std::vector<std::uint8_t> bytes = Bytes();
  const fs::path cut = folder / "cut.oni";
  std::size_t length = 0;
  for (; length < bytes.size() && !HasOniDataBegun(cut, 2); length += 28) {
    WriteWholeFile(cut, std::string_view(reinterpret_cast<const char*>(bytes.data()), length));
  }
  EXPECT_GT(length, 1000U) << "behind what is said of the streams";
  EXPECT_LT(length, 4000U) << "and before the first image";
  EXPECT_FALSE(HasOniDataBegun(folder / "missing.oni", 2));
}

TEST(OniTest, LeavesNothingBesideTheFileAndItsSideCar) {
  int files = 0;
  for (const auto& entry : fs::directory_iterator(Recording().parent_path())) {
    EXPECT_THAT(entry.path().filename().string(), ::testing::AnyOf("sweep.oni", "sweep.oni.yaml"));
    ++files;
  }
  EXPECT_EQ(files, 2);
}

TEST(OniTest, WithoutSideCarTheCameraIsNominalAndThatIsSaid) {
  const TempFolder folder;
  fs::copy_file(Recording(), folder / "foreign.oni");
  const auto recording = OpenOniRecording(folder / "foreign.oni");
  EXPECT_TRUE(recording->info().intrinsics_assumed);
  EXPECT_NEAR(recording->info().intrinsics.fx, 570.34 / 2, 0.2);
  EXPECT_THAT(EnglishTexts(recording->info().warnings),
              ::testing::Contains(HasSubstr("no foreign.oni.yaml")));
  EXPECT_EQ(ReadAll(*recording).size(), static_cast<std::size_t>(kFrames));
}

TEST(OniTest, WhatIsNoOniFileIsRefused) {
  const TempFolder folder;
  EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenOniRecording(folder / "none.oni"); }),
              HasSubstr("found nothing"));
  WriteWholeFile(folder / "text.oni", std::string_view("hello"));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenOniRecording(folder / "text.oni"); }),
              HasSubstr("does not begin with NI10"));
  WriteWholeFile(folder / "short.oni", std::string_view("NI10"));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenOniRecording(folder / "short.oni"); }),
              HasSubstr("short.oni"));
}

// The library crashes on some of these; this process must not, nor wait for ever.
TEST(OniTest, DamagedFilesAreDataErrorsOrShorter) {
  const TempFolder folder;
  const std::vector<std::uint8_t> good = Bytes();
  std::mt19937 random(3);
  int refused = 0;
  const auto read = [&](const std::vector<std::uint8_t>& bytes) {
    WriteWholeFile(folder / "bad.oni", std::span(bytes));
    try {
      const auto recording = OpenOniRecording(folder / "bad.oni");
      EXPECT_LE(ReadAll(*recording).size(), static_cast<std::size_t>(kFrames));
    } catch (const DataError&) {
      ++refused;
    }
  };
  for (int round = 0; round < 12; ++round) {
    std::vector<std::uint8_t> bytes = good;
    // The first kilobytes hold sizes, names and codecs; images are the rest.
    for (int i = 0; i < 8; ++i) bytes[24 + random() % 3000] = static_cast<std::uint8_t>(random());
    read(bytes);
  }
  for (const double share : {0.0001, 0.01, 0.5}) {
    std::vector<std::uint8_t> bytes = good;
    bytes.resize(static_cast<std::size_t>(share * static_cast<double>(good.size())));
    read(bytes);
  }
  EXPECT_GE(refused, 3);
}

/// How many readers of this process run now.
int CountReaders() {
  int count = 0;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator("/proc", error)) {
    std::ifstream status(entry.path() / "stat");
    std::string id, name, state, parent;
    if (status >> id >> name >> state >> parent)
      count += name == "(plumb-oni-reade)" && parent == std::to_string(::getpid()) ? 1 : 0;
  }
  return count;
}

TEST(OniTest, MayBeReadOnAnotherThreadThanItWasOpenedOnAndLeavesNoProcess) {
  std::unique_ptr<FrameSource> recording;
  std::thread([&] { recording = OpenOniRecording(Recording()); }).join();
  EXPECT_TRUE(recording->Next());
  EXPECT_EQ(CountReaders(), 1);
  recording.reset();  // in the middle
  EXPECT_EQ(CountReaders(), 0);
}

// The recorder forgets where each stream's stamps began; the side-car brings the delay between
// colour and depth back.
TEST(OniTest, RecordsALiveSensorWithItsStamps) {
  const TempFolder folder;
  VirtualRig rig;
  OniFileSummary written;
  std::vector<Frame> live;
  {
    const auto sensor = rig.provider.Open("");
    OniRecorder recorder(*sensor, folder / "live.oni", {});
    for (int i = 0; i < 15; ++i) live.push_back(sensor->Next().value());
    written = recorder.Finish();
  }
  EXPECT_GE(written.color_us.size(), 10U);
  EXPECT_THAT(ReadTextFile(folder / "live.oni.yaml", 4096),
              HasSubstr("sensor_serial: \"VIRTUAL-0001\""));
  const auto recording = OpenOniRecording(folder / "live.oni");
  EXPECT_FALSE(recording->info().intrinsics_assumed);
  int found = 0;
  for (const Frame& frame : ReadAll(*recording)) {
    const auto same = std::find_if(live.begin(), live.end(), [&](const Frame& f) {
      return std::abs(f.depth_time_s - frame.depth_time_s) < 5e-6;
    });
    if (same == live.end()) continue;
    ++found;
    EXPECT_NEAR(frame.color_time_s, same->color_time_s, 5e-6);
  }
  EXPECT_GE(found, 8);
}

TEST(OniTest, AnUnfinishedRecordingIsRemoved) {
  const TempFolder folder;
  VirtualRig rig;
  const auto sensor = rig.provider.Open("");
  {
    const OniRecorder recorder(*sensor, folder / "live.oni", {});
    (void)sensor->Next();
  }
  EXPECT_TRUE(fs::is_empty(folder.path()));
  EXPECT_THAT(MessageOf<IoError>(
                  [&] { OniRecorder recorder(*sensor, folder / "missing" / "live.oni", {}); }),
              HasSubstr("missing"));
}

void AddNumber(std::string& file, std::uint32_t number) {
  file.append(reinterpret_cast<const char*>(&number), sizeof number);
}

void AddRecord(std::string& file, std::uint32_t kind, std::uint32_t node, const std::string& fields,
               std::uint32_t payload) {
  const auto size = static_cast<std::uint32_t>(28 + fields.size());
  for (const std::uint32_t number : {0x0052494eU, kind, node, size, payload, 0U, 0U})
    AddNumber(file, number);
  file += fields + std::string(payload, 'x');
}

std::string NodeFields(std::uint32_t kind) {
  std::string fields;
  AddNumber(fields, 5);
  fields += "Name!";
  AddNumber(fields, kind);
  return fields;
}

std::string DataFields(std::uint32_t stamp_us) {
  std::string fields;
  for (const std::uint32_t number : {stamp_us, 1U, 7U})
    AddNumber(fields, number);  // the stamp has 64 bits
  return fields;
}

std::string SmallFile() {
  std::string file = "NI10" + std::string(20, '\0');
  AddRecord(file, 13, 1, NodeFields(3), 0);
  AddRecord(file, 13, 2, NodeFields(2), 0);
  AddRecord(file, 10, 1, DataFields(5), 1000);
  AddRecord(file, 10, 2, DataFields(6), 10);
  return file;
}

std::optional<OniFileSummary> Summarise(const std::string& file) {
  return SummariseOniFile([&](std::uint64_t offset, std::span<std::uint8_t> bytes) {
    if (offset > file.size() || bytes.size() > file.size() - offset) return false;
    std::copy_n(file.begin() + static_cast<std::ptrdiff_t>(offset), bytes.size(), bytes.begin());
    return true;
  });
}

TEST(OniFileTest, FollowsRecordsToTheEnd) {
  std::string file = SmallFile();
  EXPECT_FALSE(Summarise(file));
  AddRecord(file, 11, 0, "", 0);
  const std::size_t end = file.size();
  file.append(5000, '\0');
  const auto found = Summarise(file);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->end, end);
  EXPECT_EQ(found->color_us, std::vector<std::int64_t>{(std::int64_t{1} << 32) + 5});
  EXPECT_EQ(found->depth_us, std::vector<std::int64_t>{(std::int64_t{1} << 32) + 6});
}

TEST(OniFileTest, RefusesRecordsWithoutSizeOrMagic) {
  std::string tiny = SmallFile();
  AddRecord(tiny, 11, 0, "", 0);
  std::string other = tiny;
  ASSERT_TRUE(Summarise(tiny));
  tiny[24 + 12] = 0;  // a record of no size would be followed for ever
  EXPECT_FALSE(Summarise(tiny));
  other[24] = 'X';
  EXPECT_FALSE(Summarise(other));
  EXPECT_FALSE(Summarise("NI11"));
  EXPECT_FALSE(Summarise(""));
}

TEST(OniFileTest, FindsTheBeginThroughLossesOnBothSides) {
  std::vector<std::int64_t> true_us;
  for (int i = 0; i < 60; ++i) true_us.push_back(1'000'000 + i * 33'333 + (i * i * 37) % 600);
  std::vector<std::int64_t> recorded, seen;
  for (std::size_t i = 3; i < 50; ++i) {
    if (i % 11 != 0) recorded.push_back(true_us[i] - true_us[3]);
  }
  for (std::size_t i = 1; i < true_us.size(); ++i) {
    if (i != 3 && i % 7 != 0) seen.push_back(true_us[i]);
  }
  EXPECT_EQ(FindOniBegin(recorded, seen), true_us[3]);
  const std::vector<std::int64_t> other{1, 2'000'001, 4'000'007};
  EXPECT_FALSE(FindOniBegin(recorded, other));
}

TEST(OniFileTest, TheBeginsComeBackFromTheSideCar) {
  const OniBegin begin = ParseOniBegin("%YAML:1.0\n" + OniBeginText({1'700'000'000'134'187, 42}));
  EXPECT_EQ(begin.color_us, 1'700'000'000'134'187);
  EXPECT_EQ(begin.depth_us, 42);
  EXPECT_EQ(ParseOniBegin("a: 1\ncolor_begin_us: -5\ndepth_begin_us: x\n").color_us, 0);
}

TEST(OniTest, WhatTheSideCarSaysOfTheDepthIsUsedOrRefused) {
  const TempFolder folder;
  const fs::path file = folder / "other.oni";
  fs::copy_file(Recording(), file);
  const StreamInfo info = Source()->info();
  WriteWholeFile(OniSideCar(file), CameraFileText(info, 5000.0));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenOniRecording(file); }),
              AllOf(HasSubstr("depth_scale is 5000"), HasSubstr("millimetres")));
  const auto unregistered = [&](const std::string& camera) {
    std::string text = CameraFileText(info, 1000.0);
    text.replace(text.find("depth_registered: 1"), 19, "depth_registered: 0\n" + camera);
    WriteWholeFile(OniSideCar(file), text);
    return OpenOniRecording(file);
  };
  EXPECT_TRUE(unregistered("")->info().depth_camera_unknown);
  const Intrinsics& color = info.intrinsics;
  const auto moved = unregistered(
      fmt::format("depth_camera_matrix: [ {}, 0, {}, 0, {}, {}, 0, 0, 1 ]\n"
                  "depth_distortion_coefficients: [ 0, 0, 0, 0, 0 ]\n"
                  "T_color_depth: [ 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.25, 0, 0, 0, 1 ]\n",
                  color.fx, color.cx, color.fy, color.cy));
  EXPECT_FALSE(moved->info().depth_camera_unknown);
  const cv::Point centre(color.width / 2, color.height / 2);
  const float as_recorded_m = OpenOniRecording(Recording())->Next()->depth_m.at<float>(centre);
  ASSERT_GT(as_recorded_m, 0.0F);
  EXPECT_NEAR(moved->Next()->depth_m.at<float>(centre), as_recorded_m + 0.25, 0.02);
}

TEST(OniTest, TheDepthNoiseOfTheSideCarComesBack) {
  const TempFolder folder;
  const fs::path file = folder / "noisy.oni";
  fs::copy_file(Recording(), file);
  StreamInfo info = Source()->info();
  info.depth_noise.constant_m = 0.004;
  WriteWholeFile(OniSideCar(file), CameraFileText(info, 1000.0));
  EXPECT_EQ(OpenOniRecording(file)->info().depth_noise, info.depth_noise);
  EXPECT_EQ(OpenOniRecording(Recording())->info().depth_noise, DepthNoise());
}

}  // namespace
}  // namespace plumb
