// SPDX-License-Identifier: Apache-2.0
// plumb-oni-reader FILE COLOR_BEGIN_US DEPTH_BEGIN_US: plays an .oni file with the system's OpenNI2
// and writes its pairs of images to the standard output.
//
// A separate process, because the library crashes on damaged files.
#include <algorithm>
#include <array>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "algo/base/errors.hpp"
#include "drivers/files/reader_program.hpp"
#include "drivers/live/frame_pairing.hpp"
#include "drivers/openni/oni_protocol.hpp"
#include "drivers/openni/openni_library.hpp"
#include "words/recording.hpp"

namespace plumb {
namespace {

constexpr int kWait_ms = 200;
constexpr int kMaxWaits = 50;         // waits without an image before the file is given up
constexpr int kMaxWaitsAfterEnd = 3;  // waits after the player has reported the end
constexpr std::int64_t kMaxGap_us = 16000;
constexpr int kMaxSide = 4096;
constexpr std::uint64_t kMaxStamp_us = std::uint64_t{1} << 53;

class Player {
 public:
  using Image = std::vector<std::uint8_t>;

  /// @param begin_us  Added to the stamps of depth and colour.
  Player(const std::string& file, const std::array<std::int64_t, 2>& begin_us)
      : begin_us_(begin_us), library_(OpenNiLibrary::Load({})) {
    OniDeviceCallbacks callbacks{};
    callbacks.deviceConnected = callbacks.deviceDisconnected = [](const OniDeviceInfo*, void*) {};
    callbacks.deviceStateChanged = [](const OniDeviceInfo*, OniDeviceState state, void* self) {
      if (state == ONI_DEVICE_STATE_EOF) static_cast<Player*>(self)->at_end_ = true;
    };
    callbacks_ = callbacks;
    library_->Check(say::recording::OniNoEvents(),
                    library_->RegisterDeviceCallbacks(&callbacks_, this, &handle_));
    library_->Check(say::recording::OniCannotOpen(), library_->DeviceOpen(file.c_str(), &device_));
    library_->Check(say::recording::OniNoDepth(),
                    library_->DeviceCreateStream(device_, ONI_SENSOR_DEPTH, &streams_[0]));
    library_->Check(say::recording::OniNoColor(),
                    library_->DeviceCreateStream(device_, ONI_SENSOR_COLOR, &streams_[1]));
    const float manual = -1.0F;  // every image, in order, as fast as it is read
    const OniBool once = FALSE;
    library_->Check(say::recording::OniCannotPlay(),
                    library_->DeviceSetProperty(device_, ONI_DEVICE_PROPERTY_PLAYBACK_SPEED,
                                                &manual, sizeof manual));
    library_->Check(say::recording::OniCannotPlayOnce(),
                    library_->DeviceSetProperty(
                        device_, ONI_DEVICE_PROPERTY_PLAYBACK_REPEAT_ENABLED, &once, sizeof once));
    ReadShape();
  }

  void WriteHeader() const { WriteToParent(header_); }

  void Play() {
    for (OniStreamHandle stream : streams_)
      library_->Check(say::recording::OniNoStart(), library_->StreamStart(stream));
    FramePairing<Image> pairing(kMaxGap_us);
    std::array<int, 2> taken{};
    int waits = 0;
    while (taken[0] < num_images_[0] || taken[1] < num_images_[1]) {
      int index = -1;
      const OniStatus status = library_->WaitForAnyStream(streams_.data(), 2, &index, kWait_ms);
      if (status != ONI_STATUS_OK || index < 0 || index > 1) {
        if (++waits < (at_end_ ? kMaxWaitsAfterEnd : kMaxWaits)) continue;
        if (at_end_) break;
        throw DataError(
            say::recording::OniStopped(taken[0], taken[1], num_images_[0], num_images_[1]));
      }
      waits = 0;
      OniFrame* frame = nullptr;
      library_->Check(say::recording::OniImageUnreadable(),
                      library_->StreamReadFrame(streams_[static_cast<std::size_t>(index)], &frame));
      ++taken[static_cast<std::size_t>(index)];
      std::optional<Image> image = Copy(*frame, index == 0);
      const std::int64_t stamp =
          static_cast<std::int64_t>(std::min(frame->timestamp, kMaxStamp_us)) +
          begin_us_[static_cast<std::size_t>(index)];
      library_->FrameRelease(frame);
      if (!image) {
        ++num_damaged_;
        continue;
      }
      if (const auto pair = pairing.Add(index == 0 ? StreamKind::kDepth : StreamKind::kColor, stamp,
                                        std::move(*image))) {
        WriteToParent(oni::Kind::kFrame);
        WriteToParent(oni::FrameStamps{pair->color_us, pair->depth_us});
        WriteToParent(pair->color.data(), pair->color.size());
        WriteToParent(pair->depth.data(), pair->depth.size());
      }
    }
    WriteToParent(oni::Kind::kEnd);
    WriteToParent(oni::End{pairing.num_unpaired(), pairing.num_discarded() + num_damaged_});
  }

 private:
  template <typename Value>
  Value Get(OniStreamHandle stream, int property, Message what) const {
    Value value{};
    int size = sizeof value;
    library_->Check(std::move(what), library_->StreamGetProperty(stream, property, &value, &size));
    return value;
  }

  void ReadShape() {
    const auto depth = Get<OniVideoMode>(streams_[0], ONI_STREAM_PROPERTY_VIDEO_MODE,
                                         say::recording::OniDepthSize());
    const auto color = Get<OniVideoMode>(streams_[1], ONI_STREAM_PROPERTY_VIDEO_MODE,
                                         say::recording::OniColorSize());
    if (depth.pixelFormat != ONI_PIXEL_FORMAT_DEPTH_1_MM ||
        color.pixelFormat != ONI_PIXEL_FORMAT_RGB888) {
      throw DataError(say::recording::OniFormats(static_cast<int>(depth.pixelFormat),
                                                 static_cast<int>(color.pixelFormat)));
    }
    const bool sane = depth.resolutionX == color.resolutionX &&
                      depth.resolutionY == color.resolutionY && depth.resolutionX > 0 &&
                      depth.resolutionX <= kMaxSide && depth.resolutionY > 0 &&
                      depth.resolutionY <= kMaxSide;
    if (!sane) {
      throw DataError(say::recording::OniSizes(depth.resolutionX, depth.resolutionY,
                                               color.resolutionX, color.resolutionY));
    }
    header_.width = depth.resolutionX;
    header_.height = depth.resolutionY;
    for (std::size_t i = 0; i < 2; ++i)
      num_images_[i] = std::max(0, Get<int>(streams_[i], ONI_STREAM_PROPERTY_NUMBER_OF_FRAMES,
                                            say::recording::OniLength()));
    header_.num_frames = std::min(num_images_[0], num_images_[1]);
    int size = sizeof header_.horizontal_fov_rad;
    if (library_->StreamGetProperty(streams_[1], ONI_STREAM_PROPERTY_HORIZONTAL_FOV,
                                    &header_.horizontal_fov_rad, &size) != ONI_STATUS_OK)
      header_.horizontal_fov_rad = 0.0F;
  }

  [[nodiscard]] std::optional<Image> Copy(const OniFrame& frame, bool is_depth) const {
    const int row = header_.width * (is_depth ? 2 : 3);
    if (frame.width != header_.width || frame.height != header_.height || frame.stride < row ||
        frame.data == nullptr || frame.dataSize / frame.stride < frame.height)
      return std::nullopt;
    Image image(static_cast<std::size_t>(row) * static_cast<std::size_t>(frame.height));
    for (int y = 0; y < frame.height; ++y)
      std::memcpy(image.data() + static_cast<std::size_t>(y) * row,
                  static_cast<const char*>(frame.data) + static_cast<std::size_t>(y) * frame.stride,
                  row);
    return image;
  }

  // Nothing is closed: the process ends right after the last byte, and closing is where players
  // have hung.
  std::array<std::int64_t, 2> begin_us_;
  std::shared_ptr<const OpenNiLibrary> library_;
  OniDeviceCallbacks callbacks_{};
  OniCallbackHandle handle_ = nullptr;
  OniDeviceHandle device_ = nullptr;
  std::array<OniStreamHandle, 2> streams_{};
  std::array<int, 2> num_images_{};
  std::int64_t num_damaged_ = 0;
  oni::Header header_;
  std::atomic<bool> at_end_{false};
};

void WriteError(const std::exception& error, bool header_written) {
  const std::string text = ReaderErrorText(error);
  const auto length = static_cast<std::uint32_t>(text.size());
  if (!header_written) WriteToParent(oni::kMagic);
  WriteToParent(oni::Kind::kError);
  WriteToParent(length);
  WriteToParent(text.data(), length);
}

int Main(const std::string& file, const std::array<std::int64_t, 2>& begin_us) {
  bool header_written = false;
  try {
    auto* player = new Player(file, begin_us);  // never destroyed, see the class
    player->WriteHeader();
    header_written = true;
    player->Play();
    return 0;
  } catch (const IoError&) {
    return 1;
  } catch (const std::exception& error) {
    WriteError(error, header_written);
    return 3;
  }
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  plumb::RunReaderProgram([&] {
    return plumb::Main(argv[1], {std::atoll(argv[3]), std::atoll(argv[2])});
  });
}
