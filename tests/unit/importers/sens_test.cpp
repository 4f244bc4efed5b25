// SPDX-License-Identifier: Apache-2.0
// ScanNet's .sens files from a writer of the test's own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <random>

#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/importers/import.hpp"
#include "drivers/importers/open_recorded_file.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/importers/bag_writer.hpp"
#include "tests/unit/importers/read_from_memory.hpp"

namespace plumb {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using testing::InMemory;
using testing::MessageOf;
using testing::Packed;
using testing::TempFolder;

constexpr int kFramesOfSens = 4;

struct Sens {
  std::string name = "StructureSensor";
  std::int32_t color_packing = 2, depth_packing = 1;
  float shift_x = 0.0F;
  std::uint64_t step_us = 33333;
};

std::vector<std::uint8_t> WriteSens(const Sens& sens) {
  Packed file;
  file.Add(std::uint32_t{4}).Add(std::uint64_t{sens.name.size()});
  std::string bytes = file.bytes() + sens.name;
  Packed rest;
  const auto matrix = [&](const std::array<float, 16>& m) {
    for (const float v : m) rest.Add(v);
  };
  matrix({60, 0, 31.5F, 0, 0, 61, 23.5F, 0, 0, 0, 1, 0, 0, 0, 0, 1});
  matrix({1, 0, 0, sens.shift_x, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1});
  matrix({30, 0, 15.5F, 0, 0, 30, 11.5F, 0, 0, 0, 1, 0, 0, 0, 0, 1});
  matrix({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1});
  rest.Add(sens.color_packing).Add(sens.depth_packing);
  for (const std::uint32_t side : {64U, 48U, 32U, 24U}) rest.Add(side);
  rest.Add(1000.0F).Add(std::uint64_t{kFramesOfSens});
  bytes += rest.bytes();
  for (int i = 0; i < kFramesOfSens; ++i) {
    const auto jpeg = EncodeJpeg(cv::Mat(48, 64, CV_8UC3, cv::Scalar(200, 20 * i, 10)), 95);
    const std::vector<std::uint16_t> units(std::size_t{32} * 24,
                                           static_cast<std::uint16_t>(1500 + i));
    std::vector<std::uint8_t> packed(::compressBound(units.size() * 2));
    uLongf size = packed.size();
    ::compress(packed.data(), &size, reinterpret_cast<const Bytef*>(units.data()),
               units.size() * 2);
    Packed frame;
    for (int k = 0; k < 16; ++k) frame.Add(0.0F);
    frame.Add(sens.step_us * static_cast<std::uint64_t>(i));
    frame.Add(sens.step_us * static_cast<std::uint64_t>(i));
    frame.Add(std::uint64_t{jpeg.size()}).Add(std::uint64_t{size});
    bytes += frame.bytes();
    bytes.append(jpeg.begin(), jpeg.end());
    bytes.append(packed.begin(), packed.begin() + static_cast<std::ptrdiff_t>(size));
  }
  return {bytes.begin(), bytes.end()};
}

TEST(SensTest, FramesComeBackWithBothCameras) {
  const TempFolder folder;
  WriteWholeFile(folder / "scene.sens", WriteSens({}));
  ASSERT_TRUE(IsImportable(folder / "scene.sens"));
  const auto recording = OpenImported(folder / "scene.sens");
  EXPECT_EQ(recording->facts().format, "ScanNet .sens");
  EXPECT_EQ(recording->facts().name, "StructureSensor");
  EXPECT_EQ(recording->facts().camera.depth_sensor, DepthSensor::kStructuredLight);
  EXPECT_EQ(recording->info().intrinsics.fy, 61);
  EXPECT_EQ(recording->facts().camera.depth_camera.value().intrinsics.fx, 30);
  for (int i = 0; i < kFramesOfSens; ++i) {
    const Frame frame = recording->Next().value();
    EXPECT_NEAR(frame.depth_time_s, 0.033333 * i, 1e-6);
    EXPECT_NEAR(frame.depth_m.at<float>(24, 32), 1.5 + 1e-3 * i, 1e-5);
    EXPECT_NEAR(frame.color_rgb.at<cv::Vec3b>(20, 20)[0], 200, 6);
  }
  EXPECT_FALSE(recording->Next());
}

TEST(SensTest, ASensorWithoutANameHasTheUsualClassAndThatIsSaid) {
  const TempFolder folder;
  const auto warnings = [&](const std::string& name) {
    WriteWholeFile(folder / "scene.sens", WriteSens({.name = name}));
    return EnglishTexts(OpenImported(folder / "scene.sens")->info().warnings);
  };
  EXPECT_THAT(warnings(""), Contains(HasSubstr("structured_light is taken")));
  EXPECT_THAT(warnings("StructureSensor"),
              ::testing::Not(Contains(HasSubstr("class of the depth camera"))));
}

TEST(SensTest, WhatIsMissingIsSaid) {
  const std::vector<std::uint8_t> moved = WriteSens({.shift_x = 0.02F, .step_us = 0});
  const RecordedFacts facts = OpenRecordedFile(InMemory(moved))->facts();
  EXPECT_THAT(EnglishTexts(facts.warnings), Contains(HasSubstr("where the depth camera is")));
  EXPECT_THAT(EnglishTexts(facts.warnings), Contains(HasSubstr("30 Hz assumed")));
  EXPECT_NEAR(facts.color_s.at(3), 0.1, 1e-9);
  const std::vector<std::uint8_t> occi = WriteSens({.depth_packing = 2});
  EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenRecordedFile(InMemory(occi)); }),
              HasSubstr("zlib"));
}

TEST(SensTest, FiveHundredDamagedFilesAreReadOrRefused) {
  std::mt19937 random(11);
  const std::vector<std::uint8_t> good = WriteSens({});
  int num_refused = 0;
  for (int i = 0; i < 500; ++i) {
    std::vector<std::uint8_t> bytes = good;
    for (int change = 0; change < 1 + i % 3; ++change)
      bytes[random() % (i % 2 == 0 ? 450 : bytes.size())] = static_cast<std::uint8_t>(random());
    if (i % 5 == 0) bytes.resize(random() % bytes.size());
    try {
      const auto file = OpenRecordedFile(InMemory(bytes));
      for (std::size_t k = 0; k < file->facts().color_s.size(); ++k) {
        (void)file->Color(k);
        (void)file->Depth(k);
      }
    } catch (const DataError& error) {
      EXPECT_STRNE(error.what(), "");
      ++num_refused;
    }
  }
  EXPECT_GT(num_refused, 100);
}

}  // namespace
}  // namespace plumb
