// SPDX-License-Identifier: Apache-2.0
#include "drivers/importers/azure_mkv.hpp"

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/importers/azure_calibration.hpp"
#include "drivers/importers/ros_image.hpp"
#include "words/foreign.hpp"
#include "words/recording.hpp"

namespace plumb {
namespace {

/// Matroska's elements, as far as they are read.
enum Element : std::uint32_t {
  kSegment = 0x18538067,
  kInfo = 0x1549A966,
  kTimestampScale = 0x2AD7B1,
  kTracks = 0x1654AE6B,
  kTrackEntry = 0xAE,
  kTrackNumber = 0xD7,
  kTrackName = 0x536E,
  kCodecPrivate = 0x63A2,
  kVideo = 0xE0,
  kPixelWidth = 0xB0,
  kPixelHeight = 0xBA,
  kAttachments = 0x1941A469,
  kAttachedFile = 0x61A7,
  kFileName = 0x466E,
  kFileData = 0x465C,
  kTags = 0x1254C367,
  kTag = 0x7373,
  kSimpleTag = 0x67C8,
  kTagName = 0x45A3,
  kTagString = 0x4487,
  kCluster = 0x1F43B675,
  kClusterTimestamp = 0xE7,
  kBlockGroup = 0xA0,
  kBlock = 0xA1,
  kSimpleBlock = 0xA3
};

constexpr std::uint64_t kMostFacts = std::uint64_t{16} << 20;  ///< Bytes of all but the images.
constexpr std::uint64_t kMostImageBytes = std::uint64_t{64} << 20;
constexpr std::size_t kMostTracks = 100;
constexpr std::uint64_t kUnknownSize = ~std::uint64_t{0};

struct ElementHead {
  std::uint32_t id = 0;
  std::uint64_t size = 0;   ///< kUnknownSize: until another element of its level begins.
  std::uint64_t begin = 0;  ///< Of the contents, in the bytes that it was read from.
};

/// Takes the head of an element. @throws DataError if it is malformed or cut off.
ElementHead TakeHead(std::span<const std::uint8_t> bytes, std::uint64_t offset) {
  const auto number = [&](std::size_t most, bool keep_marker, std::size_t& at) {
    if (at >= bytes.size() || bytes[at] == 0) throw DataError(say::foreign::MkvDamaged());
    std::size_t length = 1;
    while ((bytes[at] & (0x80U >> (length - 1))) == 0) ++length;
    if (length > most || length > bytes.size() - at) throw DataError(say::foreign::MkvDamaged());
    std::uint64_t value = keep_marker ? bytes[at] : bytes[at] & (0xffU >> length);
    bool is_all_ones = !keep_marker && value == (0xffU >> length);
    for (std::size_t i = 1; i < length; ++i) {
      value = value << 8U | bytes[at + i];
      is_all_ones = is_all_ones && bytes[at + i] == 0xff;
    }
    at += length;
    return is_all_ones ? kUnknownSize : value;
  };
  std::size_t at = 0;
  ElementHead head;
  head.id = static_cast<std::uint32_t>(number(4, true, at));
  head.size = number(8, false, at);
  head.begin = offset + at;
  return head;
}

/// Calls for each element in the bytes: visit(id, contents).
template <typename Visit>
void ForEachElement(std::span<const std::uint8_t> bytes, const Visit& visit) {
  while (!bytes.empty()) {
    const ElementHead head = TakeHead(bytes, 0);
    if (head.size > bytes.size() - head.begin) throw DataError(say::foreign::MkvDamaged());
    const auto begin = static_cast<std::size_t>(head.begin);
    visit(head.id, bytes.subspan(begin, static_cast<std::size_t>(head.size)));
    bytes = bytes.subspan(begin + static_cast<std::size_t>(head.size));
  }
}

std::uint64_t UnsignedOf(std::span<const std::uint8_t> bytes) {
  if (bytes.size() > 8) throw DataError(say::foreign::MkvDamaged());
  std::uint64_t value = 0;
  for (const std::uint8_t byte : bytes) value = value << 8U | byte;
  return value;
}

std::string_view TextIn(std::span<const std::uint8_t> bytes) {
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  while (text.ends_with('\0')) text.remove_suffix(1);
  return text;
}

struct MkvTrack {
  std::uint64_t number = 0;
  std::string name;
  std::string packing;  ///< Four letters, such as MJPG.
  std::uint64_t width = 0, height = 0;
};

class AzureMkv : public RecordedFile {
 public:
  explicit AzureMkv(FileBytes bytes) : bytes_(std::move(bytes)) {
    facts_.format = "Azure Kinect / Femto .mkv";
    facts_.name = "Azure Kinect or Femto";
    ReadElements();
    ChooseTracks();
    StateImages();
  }
  [[nodiscard]] const RecordedFacts& facts() const override { return facts_; }
  [[nodiscard]] cv::Mat Color(std::size_t i) override;
  [[nodiscard]] cv::Mat Depth(std::size_t i) override;

 private:
  struct MkvImage {
    double time_s = 0.0;
    std::uint64_t track = 0, place = 0, size = 0;
  };
  [[nodiscard]] std::vector<std::uint8_t> BytesAt(std::uint64_t offset, std::uint64_t count) const {
    if (offset > bytes_.size || count > bytes_.size - offset)
      throw DataError(say::foreign::MkvCut(static_cast<std::int64_t>(offset)));
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(count));
    if (!bytes_.read(offset, bytes)) throw DataError(say::foreign::Unreadable());
    return bytes;
  }
  [[nodiscard]] std::vector<std::uint8_t> PixelsOf(const MkvImage& image, std::uint64_t expected,
                                                   const MkvTrack& track) const {
    if (image.size != expected)
      throw DataError(say::foreign::ImageSize(static_cast<std::int64_t>(track.width),
                                              static_cast<std::int64_t>(track.height),
                                              static_cast<std::int64_t>(image.size)));
    return BytesAt(image.place, image.size);
  }
  void ReadElements();
  void NoteFacts(std::uint32_t id, std::span<const std::uint8_t> content);
  void NoteTrack(std::span<const std::uint8_t> entry);
  void NoteAttachment(std::span<const std::uint8_t> file);
  void NoteTag(std::span<const std::uint8_t> tag);
  void NoteBlock(const ElementHead& head);
  void ChooseTracks();
  void StateImages();

  FileBytes bytes_;
  RecordedFacts facts_;
  std::vector<MkvTrack> tracks_;
  std::string calibration_;
  double tick_s_ = 1e-3;
  double cluster_ticks_ = 0.0;
  MkvTrack color_track_, depth_track_;
  std::vector<MkvImage> color_, depth_, images_;
};

void AzureMkv::ReadElements() {
  constexpr std::uint64_t kMostHead = 12;
  for (std::uint64_t place = 0; place < bytes_.size;) {
    const std::uint64_t there = std::min(kMostHead, bytes_.size - place);
    const ElementHead head = TakeHead(BytesAt(place, there), place);
    // These hold others, one after the other; so their sizes need not be known.
    if (head.id == kSegment || head.id == kCluster || head.id == kBlockGroup) {
      place = head.begin;
      continue;
    }
    if (head.size > bytes_.size - std::min(head.begin, bytes_.size))
      throw DataError(say::foreign::MkvCut(static_cast<std::int64_t>(place)));
    place = head.begin + head.size;
    if (head.id == kSimpleBlock || head.id == kBlock) {
      NoteBlock(head);
    } else if (head.id == kInfo || head.id == kTracks || head.id == kAttachments ||
               head.id == kTags || head.id == kClusterTimestamp) {
      if (head.size > kMostFacts) throw DataError(say::foreign::MkvDamaged());
      NoteFacts(head.id, BytesAt(head.begin, head.size));
    }
  }
}

void AzureMkv::NoteFacts(std::uint32_t id, std::span<const std::uint8_t> content) {
  if (id == kClusterTimestamp) {
    cluster_ticks_ = static_cast<double>(UnsignedOf(content));
    return;
  }
  ForEachElement(content, [&](std::uint32_t inner, std::span<const std::uint8_t> part) {
    if (id == kInfo && inner == kTimestampScale)
      tick_s_ = 1e-9 * static_cast<double>(UnsignedOf(part));
    if (id == kTracks && inner == kTrackEntry) NoteTrack(part);
    if (id == kAttachments && inner == kAttachedFile) NoteAttachment(part);
    if (id == kTags && inner == kTag) NoteTag(part);
  });
}

void AzureMkv::NoteTrack(std::span<const std::uint8_t> entry) {
  MkvTrack track;
  ForEachElement(entry, [&](std::uint32_t id, std::span<const std::uint8_t> part) {
    if (id == kTrackNumber) track.number = UnsignedOf(part);
    if (id == kTrackName) track.name = TextIn(part);
    // Windows' BITMAPINFOHEADER names the packing of the pixels.
    if (id == kCodecPrivate && part.size() >= 20) track.packing = TextIn(part.subspan(16, 4));
    if (id != kVideo) return;
    ForEachElement(part, [&](std::uint32_t inner, std::span<const std::uint8_t> value) {
      if (inner == kPixelWidth) track.width = UnsignedOf(value);
      if (inner == kPixelHeight) track.height = UnsignedOf(value);
    });
  });
  if (tracks_.size() >= kMostTracks) throw DataError(say::foreign::MkvDamaged());
  tracks_.push_back(std::move(track));
}

void AzureMkv::NoteAttachment(std::span<const std::uint8_t> file) {
  std::string_view name, data;
  ForEachElement(file, [&](std::uint32_t id, std::span<const std::uint8_t> part) {
    if (id == kFileName) name = TextIn(part);
    if (id == kFileData) data = TextIn(part);
  });
  if (name == "calibration.json") calibration_ = data;
}

void AzureMkv::NoteTag(std::span<const std::uint8_t> tag) {
  ForEachElement(tag, [&](std::uint32_t id, std::span<const std::uint8_t> simple) {
    if (id != kSimpleTag) return;
    std::string_view name, value;
    ForEachElement(simple, [&](std::uint32_t inner, std::span<const std::uint8_t> part) {
      if (inner == kTagName) name = TextIn(part);
      if (inner == kTagString) value = TextIn(part);
    });
    if (name == "K4A_DEVICE_SERIAL_NUMBER") facts_.serial = Printable(value);
    if (name == "K4A_DEPTH_FIRMWARE_VERSION") facts_.firmware = Printable(value);
  });
}

void AzureMkv::NoteBlock(const ElementHead& head) {
  constexpr std::uint64_t kMostBlockHead = 8 + 2 + 1;
  if (head.size > kMostImageBytes) throw DataError(say::foreign::MkvDamaged());
  const std::vector<std::uint8_t> first = BytesAt(head.begin, std::min(kMostBlockHead, head.size));
  // A track's number is written as a size is.
  std::size_t length = 1;
  while (!first.empty() && length <= 8 && (first[0] & (0x80U >> (length - 1))) == 0) ++length;
  if (length > 8 || first.size() < length + 3) throw DataError(say::foreign::MkvDamaged());
  std::uint64_t track = first[0] & (0xffU >> length);
  for (std::size_t i = 1; i < length; ++i) track = track << 8U | first[i];
  const auto ticks = static_cast<std::int16_t>(first[length] << 8U | first[length + 1]);
  // Several images in one block ("lacing") are for sound.
  if ((first[length + 2] & 0x06U) != 0) return;
  if (images_.size() >= 4 * kMostRecordedImages)
    throw DataError(say::foreign::TooManyImages(kMostRecordedImages));
  images_.push_back({.time_s = (cluster_ticks_ + ticks) * tick_s_,
                     .track = track,
                     .place = head.begin + length + 3,
                     .size = head.size - length - 3});
}

void AzureMkv::ChooseTracks() {
  const auto choose = [&](const char* name, std::initializer_list<const char*> packings,
                          const Message& what) {
    const auto track = std::ranges::find(tracks_, name, &MkvTrack::name);
    if (track == tracks_.end()) throw DataError(say::foreign::StreamMissing(what));
    if (std::ranges::find(packings, track->packing) == packings.end())
      throw DataError(
          say::foreign::Encoding(Printable(track->packing), {packings.begin(), packings.end()}));
    if (track->width < 1 || track->width > kMaxImageSide || track->height < 1 ||
        track->height > kMaxImageSide)
      throw DataError(say::foreign::MkvDamaged());
    return *track;
  };
  depth_track_ = choose("DEPTH", {"b16g"}, say::recording::Depth());
  color_track_ = choose("COLOR", {"MJPG", "NV12", "YUY2"}, say::recording::Colour());
  if (calibration_.empty()) throw DataError(say::foreign::AzureCalibration("calibration.json"));
  facts_.camera =
      AzureCamera(calibration_, {.color_width = static_cast<int>(color_track_.width),
                                 .color_height = static_cast<int>(color_track_.height),
                                 .depth_width = static_cast<int>(depth_track_.width),
                                 .depth_height = static_cast<int>(depth_track_.height)});
}

void AzureMkv::StateImages() {
  std::int64_t left_out = 0;
  std::ranges::stable_sort(images_, {}, &MkvImage::time_s);
  const auto take = [&](const MkvTrack& track, const Message& what, std::vector<MkvImage>& images,
                        std::vector<double>& stamps_s) {
    for (const MkvImage& image : images_) {
      if (image.track != track.number) continue;
      if (!(image.time_s >= 0 && image.time_s < 1e10) ||
          (!stamps_s.empty() && !(image.time_s > stamps_s.back()))) {
        ++left_out;
        continue;
      }
      images.push_back(image);
      stamps_s.push_back(image.time_s);
    }
    if (images.empty()) throw DataError(say::foreign::StreamMissing(what));
  };
  take(depth_track_, say::recording::Depth(), depth_, facts_.depth_s);
  take(color_track_, say::recording::Colour(), color_, facts_.color_s);
  if (left_out > 0) facts_.warnings.push_back(say::foreign::StampsRepeat(left_out));
}

cv::Mat AzureMkv::Color(std::size_t i) {
  const MkvImage& image = color_.at(i);
  if (color_track_.packing == "MJPG")
    return DecodeColorImage(BytesAt(image.place, image.size), "colour");
  const auto width = static_cast<int>(color_track_.width);
  const auto height = static_cast<int>(color_track_.height);
  const bool is_nv12 = color_track_.packing == "NV12";
  const std::uint64_t pixels = color_track_.width * color_track_.height;
  std::vector<std::uint8_t> bytes =
      PixelsOf(image, is_nv12 ? pixels / 2 * 3 : pixels * 2, color_track_);
  const cv::Mat packed = is_nv12 ? cv::Mat(height / 2 * 3, width, CV_8UC1, bytes.data())
                                 : cv::Mat(height, width, CV_8UC2, bytes.data());
  cv::Mat rgb;
  cv::cvtColor(packed, rgb, is_nv12 ? cv::COLOR_YUV2RGB_NV12 : cv::COLOR_YUV2RGB_YUY2);
  return rgb;
}

cv::Mat AzureMkv::Depth(std::size_t i) {
  const std::uint64_t pixels = depth_track_.width * depth_track_.height;
  const std::vector<std::uint8_t> bytes = PixelsOf(depth_.at(i), pixels * 2, depth_track_);
  cv::Mat depth(static_cast<int>(depth_track_.height), static_cast<int>(depth_track_.width),
                CV_16UC1);
  auto* units = depth.ptr<std::uint16_t>();
  for (std::uint64_t k = 0; k < pixels; ++k)  // The high byte first.
    units[k] = static_cast<std::uint16_t>(bytes[2 * k] << 8U | bytes[2 * k + 1]);
  return depth;
}

}  // namespace

std::unique_ptr<RecordedFile> OpenAzureMkv(FileBytes bytes) {
  return std::make_unique<AzureMkv>(std::move(bytes));
}

}  // namespace plumb
