// SPDX-License-Identifier: Apache-2.0
// Damaged and contradictory recordings: exit 3, a message that names the trouble, nothing left
// behind.
#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include <gmock/gmock.h>
#include <opencv2/core.hpp>

#include "drivers/files/image_file.hpp"
#include "tests/integration/command_line.hpp"

namespace plumb {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

/// The lines of an index file that are no comments.
std::vector<std::string> Lines(const fs::path& file) {
  std::vector<std::string> lines;
  std::istringstream in(ReadText(file));
  for (std::string line; std::getline(in, line);) {
    if (!line.empty() && line[0] != '#') lines.push_back(line);
  }
  return lines;
}

void WriteLines(const fs::path& file, const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  WriteText(file, text);
}

fs::path ImageOf(const fs::path& recording, const char* index, std::size_t line) {
  const std::string text = Lines(recording / index).at(line);
  return recording / text.substr(text.find(' ') + 1);
}

void Replace(const fs::path& file, const std::string& key, const std::string& value) {
  std::string text = ReadText(file);
  const std::size_t at = text.find(key);
  ASSERT_NE(at, std::string::npos) << key;
  text.replace(at, text.find('\n', at) - at, key + " " + value);
  WriteText(file, text);
}

struct Damage {
  const char* name;
  std::function<void(const fs::path& recording)> apply;
  const char* message;  ///< Part of what must be said.
};

[[maybe_unused]] void PrintTo(const Damage& damage, std::ostream* out) { *out << damage.name; }

std::vector<Damage> Damages() {
  const auto change_line = [](const char* index, std::size_t line,
                              const std::function<void(std::string&)>& change) {
    return [=](const fs::path& recording) {
      auto lines = Lines(recording / index);
      change(lines.at(line));
      WriteLines(recording / index, lines);
    };
  };
  const auto stamp = [](const std::string& value) {
    return [value](std::string& line) { line = value + line.substr(line.find(' ')); };
  };
  return {
      {"NoIndex", [](const fs::path& r) { fs::remove(r / "rgb.txt"); }, "rgb.txt"},
      {"EmptyIndex", [](const fs::path& r) { WriteText(r / "depth.txt", "# nothing\n"); },
       "depth.txt"},
      {"MissingImage", [](const fs::path& r) { fs::remove(ImageOf(r, "rgb.txt", 7)); }, "rgb/"},
      {"TruncatedColour",
       [](const fs::path& r) {
         fs::resize_file(ImageOf(r, "rgb.txt", 7), fs::file_size(ImageOf(r, "rgb.txt", 7)) / 2);
       },
       "rgb/"},
      {"TruncatedDepth",
       [](const fs::path& r) {
         fs::resize_file(ImageOf(r, "depth.txt", 7), fs::file_size(ImageOf(r, "depth.txt", 7)) / 2);
       },
       "depth/"},
      {"EmptyImage", [](const fs::path& r) { WriteText(ImageOf(r, "depth.txt", 7), ""); },
       "depth/"},
      {"WrongSizeColour",
       [](const fs::path& r) {
         WritePng(ImageOf(r, "rgb.txt", 7), cv::Mat(100, 100, CV_8UC3, cv::Scalar::all(90)));
       },
       "100"},
      {"WrongSizeDepth",
       [](const fs::path& r) {
         WritePng(ImageOf(r, "depth.txt", 7), cv::Mat(100, 100, CV_16UC1, cv::Scalar(5000)));
       },
       "100"},
      {"EightBitDepth",
       [](const fs::path& r) {
         WritePng(ImageOf(r, "depth.txt", 7), cv::Mat(240, 320, CV_8UC1, cv::Scalar(9)));
       },
       "16"},
      {"ColourAsDepth",
       [](const fs::path& r) {
         WritePng(ImageOf(r, "depth.txt", 7), cv::Mat(240, 320, CV_8UC3, cv::Scalar::all(9)));
       },
       "16"},
      {"NanStamp", change_line("depth.txt", 5, stamp("nan")), "depth.txt"},
      {"GarbageStamp", change_line("rgb.txt", 5, stamp("12:30")), "rgb.txt"},
      {"UnsortedStamps",
       [](const fs::path& r) {
         auto lines = Lines(r / "depth.txt");
         std::swap(lines[3], lines[9]);
         WriteLines(r / "depth.txt", lines);
       },
       "depth.txt"},
      {"DuplicatedStamps",
       [](const fs::path& r) {
         auto lines = Lines(r / "rgb.txt");
         lines.insert(lines.begin() + 4, lines[4]);
         WriteLines(r / "rgb.txt", lines);
       },
       "rgb.txt"},
      {"PathOutside",
       change_line(
           "rgb.txt", 5,
           [](std::string& line) { line = line.substr(0, line.find(' ')) + " ../../etc/passwd"; }),
       ".."},
      {"AbsolutePath",
       change_line(
           "rgb.txt", 5,
           [](std::string& line) { line = line.substr(0, line.find(' ')) + " /etc/passwd"; }),
       "/etc/passwd"},
      {"OtherSizeInCalibration",
       [](const fs::path& r) { Replace(r / "camera.yaml", "image_width:", "640"); }, "image size"},
      {"ZeroFocalLength",
       [](const fs::path& r) {
         std::string text = ReadText(r / "camera.yaml");
         const std::size_t from = text.find('[', text.find("camera_matrix")) + 1;
         text.replace(from, text.find(',', from) - from, " 0.");
         WriteText(r / "camera.yaml", text);
       },
       "camera_matrix"},
      {"UnknownDictionary",
       [](const fs::path& r) { Replace(r / "camera.yaml", "marker_dictionary:", "DICT_9X9_7"); },
       "DICT_9X9_7"},
      {"ZeroMarkerLength",
       [](const fs::path& r) { Replace(r / "camera.yaml", "marker_length:", "0."); },
       "marker_length"},
      {"NegativeMarkerLength",
       [](const fs::path& r) { Replace(r / "camera.yaml", "marker_length:", "-0.104"); },
       "marker_length"},
      {"BrokenCalibration",
       [](const fs::path& r) { WriteText(r / "camera.yaml", "%YAML:1.0\n---\nimage_width: ["); },
       "camera.yaml"},
      {"AllDepthZero",
       [](const fs::path& r) {
         for (std::size_t i = 0; i < Lines(r / "depth.txt").size(); ++i)
           WritePng(ImageOf(r, "depth.txt", i), cv::Mat::zeros(240, 320, CV_16UC1));
       },
       "depth"},
      {"SingleFrame",
       [](const fs::path& r) {
         for (const char* index : {"rgb.txt", "depth.txt"})
           WriteLines(r / index, {Lines(r / index).front()});
       },
       "frame"},
  };
}

class BadRecordingTest : public CommandLineTest, public testing::WithParamInterface<Damage> {};

TEST_P(BadRecordingTest, IsRefusedWithAMessageAndNothingIsLeft) {
  const fs::path recording = Copy(SmallRecording(SmallNames()[0]), "recording");
  GetParam().apply(recording);
  const RunResult result = Plumb({"reconstruct", recording, "--out", folder_ / "scene"});
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_THAT(result.err, HasSubstr(GetParam().message));
  EXPECT_EQ(result.out, "");
  EXPECT_THAT(LeftBehind({"recording"}), IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(All, BadRecordingTest, testing::ValuesIn(Damages()),
                         [](const auto& test) { return std::string(test.param.name); });

class RecordingTest : public CommandLineTest {};

TEST_F(RecordingTest, ThatIsMissingIsBadInput) {
  const RunResult result = Plumb({"reconstruct", folder_ / "nowhere", "--out", folder_ / "scene"});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.err, HasSubstr("nowhere"));
  EXPECT_THAT(LeftBehind({}), IsEmpty());
  EXPECT_EQ(Plumb({"info", folder_ / "nowhere"}).exit_code, 3);
}

TEST_F(RecordingTest, ThatIsAnEmptyFolderIsBadInput) {
  fs::create_directory(folder_ / "empty");
  EXPECT_EQ(Plumb({"reconstruct", folder_ / "empty", "--out", folder_ / "scene"}).exit_code, 3);
  EXPECT_EQ(Plumb({"info", folder_ / "empty"}).exit_code, 3);
  EXPECT_THAT(LeftBehind({"empty"}), IsEmpty());
}

/// The depth images as a RealSense delivers them: of a camera 15 mm beside the colour camera, with
/// five eighths of its focal length.
void TakeFromDepthCamera(const fs::path& recording) {
  constexpr double kZoom = 0.625, kOffset_m = 0.015, kFocal_px = 262.5, kUnits = 5000;
  for (std::size_t i = 0; i < Lines(recording / "depth.txt").size(); ++i) {
    const fs::path file = ImageOf(recording, "depth.txt", i);
    const cv::Mat registered = ReadDepthImage(file);
    cv::Mat own = cv::Mat::zeros(registered.size(), CV_16UC1);
    for (int r = 0; r < registered.rows; ++r) {
      for (int c = 0; c < registered.cols; ++c) {
        const std::uint16_t z = registered.at<std::uint16_t>(r, c);
        if (z == 0) continue;
        const double moved_px = kFocal_px * kOffset_m / (z / kUnits);
        const auto x = static_cast<int>(std::lround(kZoom * (c - 159.5 - moved_px) + 160.5));
        const auto y = static_cast<int>(std::lround(kZoom * (r - 119.5) + 118.25));
        if (x < 0) continue;
        std::uint16_t& nearest = own.at<std::uint16_t>(y, x);
        if (nearest == 0 || z < nearest) nearest = z;
      }
    }
    WritePng(file, own);
  }
}

TEST_F(RecordingTest, WithoutCamerasIsReadOrRefusedByWhetherTheAssumedOnesFit) {
  const fs::path recording = Copy(SmallRecording(SmallNames()[0]), "recording");
  fs::remove(recording / "camera.yaml");
  const RunResult fits = Plumb({"reconstruct", recording, "--out", folder_ / "fits", "--json"});
  ASSERT_EQ(fits.exit_code, 0) << fits.err;
  EXPECT_THAT(fits.out, testing::Not(HasSubstr("nothing states")));
  TakeFromDepthCamera(recording);
  const RunResult unfit = Plumb({"reconstruct", recording, "--out", folder_ / "unfit"});
  EXPECT_EQ(unfit.exit_code, 3);
  EXPECT_THAT(unfit.err, HasSubstr("nothing states the sensor's cameras"));
  EXPECT_THAT(unfit.err, HasSubstr("depth is not registered to colour"));
  EXPECT_THAT(LeftBehind({"recording", "fits"}), IsEmpty());
}

/// A fault that no reader sees, and what reconstruct says of it.
struct PlantedFault {
  const char* name;
  std::function<void(const fs::path& recording)> apply;
  const char* message;
};

[[maybe_unused]] void PrintTo(const PlantedFault& fault, std::ostream* out) { *out << fault.name; }

std::vector<PlantedFault> PlantedFaults() {
  const auto flip_depth = [](int how) {
    return [how](const fs::path& recording) {
      for (std::size_t i = 0; i < Lines(recording / "depth.txt").size(); ++i) {
        const fs::path file = ImageOf(recording, "depth.txt", i);
        cv::Mat turned;
        cv::flip(ReadDepthImage(file), turned, how);
        WritePng(file, turned);
      }
    };
  };
  return {
      {"DepthMirrored", flip_depth(1), "refused    the depth images are mirrored left to right"},
      {"DepthTurned", flip_depth(-1), "refused    the depth images are turned by half a turn"},
      {"EveryThirdDepthImageRepeated",
       [](const fs::path& recording) {
         for (std::size_t i = 2; i < Lines(recording / "depth.txt").size(); i += 3)
           fs::copy_file(ImageOf(recording, "depth.txt", i - 1), ImageOf(recording, "depth.txt", i),
                         fs::copy_options::overwrite_existing);
       },
       "10 of 30 depth images repeat the one before and were left out"},
      {"ImagesOfAnotherSizeCalibrated",
       [](const fs::path& recording) {
         std::string text = ReadText(recording / "camera.yaml");
         const std::size_t from = text.find('[', text.find("camera_matrix")) + 1;
         text.replace(from, text.find(']', from) - from,
                      "392., 0., 200., 0., 392., 150., 0., 0., 1.");
         WriteText(recording / "camera.yaml", text);
       },
       "or camera_matrix is of images of another size (by the depth, the focal length is 26"},
      {"Dark",
       [](const fs::path& recording) {
         for (std::size_t i = 0; i < Lines(recording / "rgb.txt").size(); ++i) {
           const fs::path file = ImageOf(recording, "rgb.txt", i);
           WritePng(file, ReadColorImage(file) * 0.1);
         }
       },
       "the colour images are dark"},
  };
}

class PlantedFaultTest : public CommandLineTest,
                         public testing::WithParamInterface<PlantedFault> {};

TEST_P(PlantedFaultTest, IsNamed) {
  const fs::path recording = Copy(SmallRecording(SmallNames()[0]), "recording");
  GetParam().apply(recording);
  const RunResult result = Plumb({"reconstruct", recording, "--out", folder_ / "scene"});
  EXPECT_THAT(result.out + result.err, HasSubstr(GetParam().message));
  EXPECT_THAT(result.out, testing::Not(HasSubstr("print them at the size")));
}

INSTANTIATE_TEST_SUITE_P(All, PlantedFaultTest, testing::ValuesIn(PlantedFaults()),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace plumb
