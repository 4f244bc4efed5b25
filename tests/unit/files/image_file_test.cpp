// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/image_file.hpp"

#include <sys/resource.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::MessageOf;
using testing::TempFolder;

using Bytes = std::vector<std::uint8_t>;

/// Red rises to the right, green downwards, blue is constant: a swapped channel or axis shows.
cv::Mat ColorRamp(int width, int height) {
  cv::Mat image(height, width, CV_8UC3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      image.at<cv::Vec3b>(y, x) = cv::Vec3b(static_cast<std::uint8_t>(x * 255 / width),
                                            static_cast<std::uint8_t>(y * 255 / height), 40);
    }
  }
  return image;
}

cv::Mat DepthRamp(int width, int height) {
  cv::Mat image(height, width, CV_16UC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      image.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(257 * x + 7 * y + 3);
  }
  return image;
}

bool Same(const cv::Mat& a, const cv::Mat& b) {
  if (a.type() != b.type() || a.size() != b.size()) return false;
  for (int row = 0; row < a.rows; ++row) {
    if (!std::equal(a.ptr(row), a.ptr(row) + a.elemSize() * static_cast<std::size_t>(a.cols),
                    b.ptr(row)))
      return false;
  }
  return true;
}

Bytes FromHex(std::string_view hex) {
  Bytes bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2) {
    bytes.push_back(
        static_cast<std::uint8_t>(std::stoi(std::string(hex.substr(i, 2)), nullptr, 16)));
  }
  return bytes;
}

// Made with Python's zlib and struct modules, which share nothing with libpng's encoder.
// 4x1, 16-bit grey: 1, 256, 0x1234, 65535.
constexpr std::string_view kForeignDepthPng =
    "89504e470d0a1a0a0000000d49484452000000040000000110000000008cc78c520000001149444154789c63606064"
    "641032f9ff1f0003f702472b9777150000"
    "000049454e44ae426082";
// 2x1, palette (10 20 30), (200 100 50) with a transparency chunk, pixels 1 0.
constexpr std::string_view kForeignPalettePng =
    "89504e470d0a1a0a0000000d4948445200000002000000010803000000c3fc8fb800000006504c54450a141ec86432"
    "77a0b39c0000000174524e5380ad5e5b46"
    "0000000b49444154789c636064000000050002d16633780000000049454e44ae426082";

TEST(ImageFileTest, PngKeepsEveryPixelOfEveryKind) {
  const TempFolder folder;
  WritePng(folder / "color.png", ColorRamp(61, 47));
  WritePng(folder / "depth.png", DepthRamp(61, 47));
  EXPECT_TRUE(Same(ReadColorImage(folder / "color.png"), ColorRamp(61, 47)));
  EXPECT_TRUE(Same(ReadDepthImage(folder / "depth.png"), DepthRamp(61, 47)));
}

TEST(ImageFileTest, PngOfAPartOfALargerImageIsThatPart) {
  const cv::Mat part = DepthRamp(61, 47)(cv::Rect(5, 7, 20, 11));
  EXPECT_TRUE(Same(DecodeDepthImage(EncodePng(part), "part"), part));
}

TEST(ImageFileTest, ReadsDepthOfAnotherEncoderInItsByteOrder) {
  const cv::Mat image = DecodeDepthImage(FromHex(kForeignDepthPng), "foreign");
  ASSERT_EQ(image.size(), cv::Size(4, 1));
  EXPECT_THAT(std::vector<std::uint16_t>(image.begin<std::uint16_t>(), image.end<std::uint16_t>()),
              ::testing::ElementsAre(1, 256, 0x1234, 65535));
}

TEST(ImageFileTest, ColorIsRgbWhateverThePngHolds) {
  const cv::Mat palette = DecodeColorImage(FromHex(kForeignPalettePng), "palette");
  ASSERT_EQ(palette.size(), cv::Size(2, 1));
  EXPECT_EQ(palette.at<cv::Vec3b>(0, 0), cv::Vec3b(200, 100, 50));
  EXPECT_EQ(palette.at<cv::Vec3b>(0, 1), cv::Vec3b(10, 20, 30));

  const cv::Mat grey = DecodeColorImage(EncodePng(cv::Mat(3, 5, CV_8UC1, cv::Scalar(77))), "grey");
  EXPECT_EQ(grey.at<cv::Vec3b>(2, 4), cv::Vec3b(77, 77, 77));
}

TEST(ImageFileTest, JpegKeepsColoursAndOrientation) {
  const TempFolder folder;
  const cv::Mat ramp = ColorRamp(128, 96);
  WriteWholeFile(folder / "a.jpg", EncodeJpeg(ramp, 95));
  const cv::Mat read = ReadColorImage(folder / "a.jpg");
  ASSERT_EQ(read.size(), ramp.size());
  int worst = 0;
  for (int y = 0; y < ramp.rows; ++y) {
    for (int x = 0; x < ramp.cols; ++x) {
      for (int c = 0; c < 3; ++c)
        worst =
            std::max(worst, std::abs(read.at<cv::Vec3b>(y, x)[c] - ramp.at<cv::Vec3b>(y, x)[c]));
    }
  }
  EXPECT_LE(worst, 5);  // measured 3 at quality 95
}

TEST(ImageFileTest, EncodingIsRepeatable) {
  EXPECT_EQ(EncodePng(ColorRamp(64, 48)), EncodePng(ColorRamp(64, 48)));
  EXPECT_EQ(EncodeJpeg(ColorRamp(64, 48), 90), EncodeJpeg(ColorRamp(64, 48), 90));
}

TEST(ImageFileTest, EightBitDepthIsNamed) {
  EXPECT_THAT(MessageOf<DataError>([] {
                (void)DecodeDepthImage(EncodePng(cv::Mat(4, 4, CV_8UC1, cv::Scalar(9))),
                                       "depth/7.png");
              }),
              AllOf(HasSubstr("depth/7.png"), HasSubstr("1 channel of 8 bits"),
                    HasSubstr("expected 1 channel of 16 bits")));
}

TEST(ImageFileTest, ThreeChannelDepthIsNamed) {
  EXPECT_THAT(MessageOf<DataError>(
                  [] { (void)DecodeDepthImage(EncodePng(ColorRamp(4, 4)), "depth/7.png"); }),
              AllOf(HasSubstr("depth/7.png"), HasSubstr("3 channels of 8 bits"),
                    HasSubstr("expected 1 channel of 16 bits")));
}

TEST(ImageFileTest, JpegDepthIsNamed) {
  EXPECT_THAT(MessageOf<DataError>(
                  [] { (void)DecodeDepthImage(EncodeJpeg(ColorRamp(8, 8), 90), "depth/7.png"); }),
              AllOf(HasSubstr("depth/7.png"), HasSubstr("16-bit PNG"), HasSubstr("is JPEG")));
}

TEST(ImageFileTest, MissingFileFolderAndPipeAreErrors) {
  const TempFolder folder;
  EXPECT_THAT(MessageOf<DataError>([&] { (void)ReadColorImage(folder / "none.png"); }),
              AllOf(HasSubstr("none.png"), HasSubstr("missing")));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)ReadColorImage(folder.path()); }),
              HasSubstr("not a regular file"));
  ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_THAT(MessageOf<DataError>([&] { (void)ReadColorImage(folder / "pipe"); }),
              HasSubstr("not a regular file"));
  WriteWholeFile(folder / "empty.png", std::string_view());
  EXPECT_THAT(MessageOf<DataError>([&] { (void)ReadColorImage(folder / "empty.png"); }),
              HasSubstr("empty"));
  WriteWholeFile(folder / "text.png", std::string_view("hello"));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)ReadColorImage(folder / "text.png"); }),
              HasSubstr("68 65 6c 6c"));
}

// Wherever a file is cut, nothing is accepted: no grey lower half, no missing check sum.
TEST(ImageFileTest, EveryTruncationIsAnError) {
  const Bytes png = EncodePng(DepthRamp(24, 16));
  const Bytes jpeg = EncodeJpeg(ColorRamp(40, 24), 90);
  const cv::Mat grid(150, 3, CV_32FC1, cv::Scalar(1.5));
  const Bytes tiff = EncodeFloatTiff(grid);
  for (std::size_t size = 0; size < png.size(); ++size) {
    EXPECT_THROW((void)DecodeDepthImage(std::span(png).first(size), "cut"), DataError)
        << size << " of " << png.size();
  }
  // The last byte of a JPEG is half of its end marker: libjpeg reads on without it, every pixel
  // being there.
  for (std::size_t size = 0; size + 2 < jpeg.size(); ++size) {
    EXPECT_THROW((void)DecodeColorImage(std::span(jpeg).first(size), "cut"), DataError)
        << size << " of " << jpeg.size();
  }
  for (std::size_t size = 0; size < tiff.size(); ++size) {
    EXPECT_THROW((void)DecodeFloatTiff(std::span(tiff).first(size), "cut"), DataError)
        << size << " of " << tiff.size();
  }
}

// One byte changed anywhere: an error or an image of a bounded size, never a crash (run under the
// sanitizers too).
TEST(ImageFileTest, NoChangedByteCrashesADecoder) {
  const Bytes png = EncodePng(DepthRamp(24, 16));
  const Bytes jpeg = EncodeJpeg(ColorRamp(40, 24), 90);
  const Bytes tiff = EncodeFloatTiff(cv::Mat(15, 3, CV_32FC1, cv::Scalar(1.5)));
  int refused = 0;
  const auto try_all = [&](Bytes bytes, const auto& decode) {
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      for (const std::uint8_t flip : {0x01, 0x80, 0xff}) {
        bytes[i] ^= flip;
        try {
          decode(bytes);
        } catch (const DataError&) {
          ++refused;
        }
        bytes[i] ^= flip;
      }
    }
  };
  try_all(png, [](const Bytes& bytes) { (void)DecodeDepthImage(bytes, "changed"); });
  EXPECT_EQ(refused, static_cast<int>(3 * png.size()));  // check sums cover every byte of a PNG
  try_all(jpeg, [](const Bytes& bytes) { (void)DecodeColorImage(bytes, "changed"); });
  try_all(tiff, [](const Bytes& bytes) { (void)DecodeFloatTiff(bytes, "changed"); });
}

TEST(ImageFileTest, HeadersThatPromiseTooMuchAreRefusedBeforeMemoryIsTaken) {
  Bytes png = EncodePng(cv::Mat(1, 4097, CV_16UC1, cv::Scalar(1)));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)DecodeDepthImage(png, "wide"); }),
              AllOf(HasSubstr("4097x1"), HasSubstr("4096")));
  const Bytes jpeg = EncodeJpeg(cv::Mat(1, 4097, CV_8UC3, cv::Scalar(1, 2, 3)), 90);
  EXPECT_THAT(MessageOf<DataError>([&] { (void)DecodeColorImage(jpeg, "wide"); }),
              HasSubstr("4097x1"));
  Bytes tiff = EncodeFloatTiff(cv::Mat(4, 4, CV_32FC1, cv::Scalar(0)));
  // The directory's width and height entries (tags 256 and 257) say 16000: 1 GB from a file of 200
  // bytes.
  for (std::size_t i = 0; i + 12 <= tiff.size(); ++i) {
    if ((tiff[i] == 0 || tiff[i] == 1) && tiff[i + 1] == 1 && tiff[i + 4] == 1 &&
        tiff[i + 8] == 4) {
      tiff[i + 8] = 0x80;
      tiff[i + 9] = 0x3e;
    }
  }
  EXPECT_THAT(MessageOf<DataError>([&] { (void)DecodeFloatTiff(tiff, "grid"); }),
              HasSubstr("16000x16000"));
}

TEST(ImageFileTest, TiffKeepsFloatsBitForBit) {
  const TempFolder folder;
  cv::Mat values(70, 33, CV_32FC1);
  for (int y = 0; y < values.rows; ++y) {
    for (int x = 0; x < values.cols; ++x)
      values.at<float>(y, x) = static_cast<float>(y) + 1e-3F * static_cast<float>(x);
  }
  values.at<float>(3, 4) = std::numeric_limits<float>::quiet_NaN();
  WriteFloatTiff(folder / "h.tiff", values);
  EXPECT_TRUE(Same(ReadFloatTiff(folder / "h.tiff"), values));
  EXPECT_EQ(EncodeFloatTiff(values), EncodeFloatTiff(values));
}

TEST(ImageFileTest, TiffOfAnotherKindIsNamed) {
  // Little-endian TIFF by hand: 1x1, 8 bits, one strip.
  const Bytes tiff = FromHex(
      "49492a0008000000"
      "0600"
      "000103000100000001000000"
      "010103000100000001000000"
      "020103000100000008000000"
      "060103000100000001000000"
      "1101040001000000"
      "08000000"
      "1701040001000000"
      "01000000"
      "00000000");
  EXPECT_THAT(MessageOf<DataError>([&] { (void)DecodeFloatTiff(tiff, "heightmap.tiff"); }),
              AllOf(HasSubstr("heightmap.tiff"), HasSubstr("1 channel of 8 bits"),
                    HasSubstr("32-bit floats")));
}

TEST(ImageFileTest, WritingWhatCannotBeWrittenIsTheCallersMistake) {
  EXPECT_THROW((void)EncodePng(cv::Mat()), std::invalid_argument);
  EXPECT_THROW((void)EncodePng(cv::Mat(2, 2, CV_32FC1)), std::invalid_argument);
  EXPECT_THROW((void)EncodeJpeg(ColorRamp(8, 8), 0), std::invalid_argument);
  EXPECT_THROW((void)EncodeJpeg(DepthRamp(8, 8), 90), std::invalid_argument);
  EXPECT_THROW((void)EncodeFloatTiff(DepthRamp(8, 8)), std::invalid_argument);
  EXPECT_THROW(WritePng("/nonexistent/folder/a.png", ColorRamp(4, 4)), IoError);
}

TEST(FileIoTest, TooManyOpenFilesAreNotTheFilesFault) {
  const testing::TempFolder folder;
  WriteWholeFile(folder / "good", std::string_view("text"));
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  const rlimit none{.rlim_cur = 0, .rlim_max = before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  std::string reported;
  try {
    (void)ReadTextFile(folder / "good", 100);
  } catch (const DataError&) {
    reported = "the file is blamed";
  } catch (const IoError& error) {
    reported = error.what();
  }
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &before), 0);
  EXPECT_THAT(reported, ::testing::HasSubstr("LimitNOFILE"));
}

}  // namespace
}  // namespace plumb
