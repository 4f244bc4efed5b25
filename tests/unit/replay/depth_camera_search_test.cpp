// SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/depth_camera_search.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "drivers/files/file_io.hpp"
#include "drivers/replay/tum_recording.hpp"
#include "drivers/replay/tum_writer.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

Intrinsics Color() {
  return {.width = 320, .height = 240, .fx = 262, .fy = 262, .cx = 161, .cy = 118};
}
/// As in sensors of the Kinect's class: it magnifies by a tenth more, 25 mm beside.
DepthCamera Infrared() {
  DepthCamera depth;
  depth.intrinsics = {.width = 320, .height = 240, .fx = 290, .fy = 290, .cx = 157, .cy = 122};
  depth.T_color_depth.translation().x() = -0.025;
  return depth;
}
DepthCamera SameAsColor() { return {.intrinsics = Color()}; }

/// A grey board that faces the cameras, in the colour camera's frame.
struct Board {
  double left_m, top_m, width_m, height_m, z_m;
  int grey;
};

/// Boards of many distances and greys before a wall.
std::vector<Board> RoomOfBoards(unsigned seed) {
  std::mt19937 random(seed);
  const auto in = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random()) / std::mt19937::max();
  };
  std::vector<Board> boards = {{-10, -10, 20, 20, 3.0, 128}};
  for (int i = 0; i < 14; ++i) {
    const double z_m = in(0.8, 2.4);
    boards.push_back({z_m * in(-0.6, 0.5), z_m * in(-0.45, 0.35), in(0.1, 0.4), in(0.1, 0.4), z_m,
                      static_cast<int>(in(0, 255))});
  }
  return boards;
}

/// The nearest board that a pixel's ray meets.
const Board& Seen(const std::vector<Board>& boards, const DepthCamera& camera, int x, int y) {
  const Eigen::Vector2d ray = Undistort(camera.intrinsics, Eigen::Vector2d(x, y));
  const Eigen::Vector3d from = camera.T_color_depth.translation();
  const Board* nearest = &boards.front();
  for (const Board& board : boards) {
    const Eigen::Vector2d p = from.head<2>() + ray * (board.z_m - from.z());
    if (board.z_m < nearest->z_m && p.x() > board.left_m && p.x() < board.left_m + board.width_m &&
        p.y() > board.top_m && p.y() < board.top_m + board.height_m)
      nearest = &board;
  }
  return *nearest;
}

std::vector<ImagePair> Images(const DepthCamera& depth_camera, int num_pairs = 12) {
  std::vector<ImagePair> pairs;
  for (int i = 0; i < num_pairs; ++i) {
    const std::vector<Board> boards = RoomOfBoards(static_cast<unsigned>(i + 1));
    ImagePair pair{cv::Mat(240, 320, CV_8UC3), cv::Mat(240, 320, CV_32FC1)};
    for (int y = 0; y < 240; ++y) {
      for (int x = 0; x < 320; ++x) {
        const int grey = Seen(boards, SameAsColor(), x, y).grey;
        pair.color_rgb.at<cv::Vec3b>(y, x) = cv::Vec3b::all(static_cast<unsigned char>(grey));
        pair.depth_m.at<float>(y, x) = static_cast<float>(Seen(boards, depth_camera, x, y).z_m);
      }
    }
    pairs.push_back(pair);
  }
  return pairs;
}

/// The distance by which points of 1 m to 3 m land beside their place in the colour image, at most.
double LandBeside(const DepthCamera& found, const DepthCamera& truth,
                  const std::vector<Eigen::Vector2d>& pixels) {
  double most_px = 0.0;
  for (const double z_m : {1.0, 3.0}) {
    for (const Eigen::Vector2d& pixel : pixels) {
      const auto lands = [&](const DepthCamera& camera) {
        const Eigen::Vector3d p = z_m * Undistort(camera.intrinsics, pixel).homogeneous();
        return Project(Color(), camera.T_color_depth * p);
      };
      most_px = std::max(most_px, (lands(found) - lands(truth)).norm());
    }
  }
  return most_px;
}

TEST(DepthCameraSearchTest, FindsTheInfraredCameraOfAKinect) {
  const std::optional<FoundDepthCamera> found = FindDepthCamera(Images(Infrared()), Color());
  ASSERT_TRUE(found);
  EXPECT_GT(found->gain, 2.0);
  EXPECT_LT(LandBeside(found->camera, Infrared(), {{40, 40}, {280, 200}}), 0.5);  // 0.33
}

TEST(DepthCameraSearchTest, ADepthCameraBeyondTheSearchIsNotFound) {
  // 1.57: a RealSense D435's (613.20 and 390.43 px at 640x480).
  for (const double zoom : {0.75, 1.15, 1.5706, 2.0}) {
    DepthCamera depth = Infrared();
    depth.intrinsics.fx = depth.intrinsics.fy = Color().fx / zoom;
    EXPECT_FALSE(FindDepthCamera(Images(depth), Color())) << zoom;
  }
}

TEST(DepthCameraSearchTest, RegisteredDepthIsLeftAsItIs) {
  EXPECT_FALSE(FindDepthCamera(Images(SameAsColor()), Color()));
}

TEST(DepthCameraSearchTest, AShiftThatTheJointSolveFindsIsNoOtherCamera) {
  DepthCamera shifted = SameAsColor();
  shifted.intrinsics.cx += 2.0;
  shifted.intrinsics.cy -= 1.0;
  EXPECT_FALSE(FindDepthCamera(Images(shifted), Color()));
}

TEST(DepthCameraSearchTest, WithoutStepsInDepthNothingIsFound) {
  std::vector<ImagePair> pairs = Images(Infrared());
  for (ImagePair& pair : pairs) pair.depth_m.setTo(1.5F);
  EXPECT_FALSE(FindDepthCamera(pairs, Color()));
  EXPECT_FALSE(FindDepthCamera({}, Color()));
}

TEST(DepthCameraSearchTest, DepthOfAnotherRoomShowsNoCamera) {
  std::vector<ImagePair> pairs = Images(Infrared());
  for (std::size_t i = 0; i + 1 < pairs.size(); i += 2)
    std::swap(pairs[i].depth_m, pairs[i + 1].depth_m);
  EXPECT_FALSE(FindDepthCamera(pairs, Color()));
}

/// A recording of `pairs` that says that its depth is not registered, and no more.
void WriteUnregistered(const std::filesystem::path& folder, const std::vector<ImagePair>& pairs) {
  StreamInfo info;
  info.intrinsics = Color();
  TumWriter writer(folder, info, {.jpeg_quality = 0});
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const double time_s = 100.0 + static_cast<double>(i) / 30.0;
    writer.Add({.index = static_cast<std::int64_t>(i),
                .color_time_s = time_s,
                .depth_time_s = time_s,
                .color_rgb = pairs[i].color_rgb,
                .depth_m = pairs[i].depth_m});
  }
  writer.Finish();
  std::string camera = ReadTextFile(folder / "camera.yaml", 1 << 16);
  camera.replace(camera.find("depth_registered: 1"), 19, "depth_registered: 0");
  WriteWholeFile(folder / "camera.yaml", camera);
}

/// Share of the first frame's measured pixels within 1 % of what the colour camera would see.
double ShareInPlace(TumSource& source) {
  const cv::Mat depth_m = source.Next()->depth_m;
  const cv::Mat expected_m = Images(SameAsColor(), 1)[0].depth_m;
  const cv::Mat in_place = cv::abs(depth_m - expected_m) < 0.01 * expected_m;
  return cv::countNonZero(in_place) / static_cast<double>(cv::countNonZero(depth_m));
}

TEST(DepthCameraSearchTest, ARecordingIsReadWithTheCameraThatWasFound) {
  const testing::TempFolder folder;
  WriteUnregistered(folder / "kinect", Images(Infrared()));
  const auto kinect = OpenTumRecording(folder / "kinect");
  // Measured: 0.997, and 0.858 where the depth is taken as registered.
  EXPECT_GT(ShareInPlace(*kinect), 0.98);
  EXPECT_THAT(EnglishTexts(kinect->info().warnings),
              ::testing::Contains(::testing::HasSubstr("focal length")));
  EXPECT_TRUE(kinect->info().depth_camera_estimated);
  EXPECT_FALSE(kinect->info().depth_camera_unknown);
  EXPECT_TRUE(kinect->camera().depth_camera);
}

TEST(DepthCameraSearchTest, ARecordingWhoseDepthCameraIsNotFoundSaysThatItIsUnknown) {
  const testing::TempFolder folder;
  WriteUnregistered(folder / "registered", Images(SameAsColor()));
  const auto source = OpenTumRecording(folder / "registered");
  EXPECT_TRUE(source->info().depth_camera_unknown);
  EXPECT_FALSE(source->info().depth_camera_estimated);
  EXPECT_THAT(EnglishTexts(source->info().warnings),
              ::testing::Not(::testing::Contains(::testing::HasSubstr("focal length"))));
  EXPECT_GT(ShareInPlace(*source), 0.99) << "the images as they are";
  // Written again, it still says so.
  TumWriter writer(folder / "again", source->info(), {.jpeg_quality = 0});
  while (const auto frame = source->Next()) writer.Add(*frame);
  writer.Finish();
  EXPECT_TRUE(OpenTumRecording(folder / "again")->info().depth_camera_unknown);
}

TEST(DepthCameraSearchTest, ImagesOfAnotherSizeAreACallersMistake) {
  Intrinsics larger = Color();
  larger.width = 640;
  EXPECT_THROW((void)FindDepthCamera(Images(Infrared(), 1), larger), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
