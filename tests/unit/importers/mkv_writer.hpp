// SPDX-License-Identifier: Apache-2.0
// Writes Matroska files as k4arecorder does, by the published formats and none of the reader's
// code.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace plumb::testing {

/// A device's calibration: keys, order and sizes are those of real ones.
inline std::string AzureCalibrationText() {
  return R"({"CalibrationInformation":{"Cameras":[{"Intrinsics":{"ModelParameterCount":14,)"
         R"("ModelParameters":[0.51,0.49,0.4921,0.4922,3.13,2.32,0.13,3.46,3.35,0.66,0,0,-5e-05,8e-05],)"
         R"("ModelType":"CALIBRATION_LensDistortionModelBrownConrady"},)"
         R"("Location":"CALIBRATION_CameraLocationD0","Purpose":"CALIBRATION_CameraPurposeDepth",)"
         R"("MetricRadius":1.74,"Rt":{"Rotation":[1,0,0,0,1,0,0,0,1],"Translation":[0,0,0]},)"
         R"("SensorHeight":1024,"SensorWidth":1024},{"Intrinsics":{"ModelParameterCount":14,)"
         R"("ModelParameters":[0.4968,0.5109,0.4709,0.6274,0.7227,-2.8856,1.6327,0.6022,-2.7196,)"
         R"(1.5651,0,0,-0.000143,0.000783],"ModelType":"CALIBRATION_LensDistortionModelBrownConrady"},)"
         R"("Location":"CALIBRATION_CameraLocationPV0",)"
         R"("Purpose":"CALIBRATION_CameraPurposePhotoVideo","MetricRadius":0,)"
         R"("Rt":{"Rotation":[1,0,0,0,1,0,0,0,1],"Translation":[-0.032,-0.002,0.004]},)"
         R"("SensorHeight":3072,"SensorWidth":4096}]}})";
}

/// What a test changes of the file.
struct AzureTruth {
  std::string color_packing = "MJPG";
  int color_width = 1280, color_height = 720, depth_width = 320, depth_height = 288;
  std::vector<std::string> colors, depths;  ///< The images as they are stored.
  std::string calibration = AzureCalibrationText() + '\0';
  bool known_sizes = true;  ///< Of segment and clusters; not so in a file that is being written.
  bool groups = false;      ///< Blocks in groups, as mkvmerge may write them.
};

class MkvWriter {
 public:
  static std::vector<std::uint8_t> Write(const AzureTruth& truth) {
    std::string segment;
    segment += Element({0x15, 0x49, 0xA9, 0x66},
                       Number({0x2A, 0xD7, 0xB1}, 1000) + Element({0x57, 0x41}, "k4arecord-1.4.1"));
    segment +=
        Element({0x16, 0x54, 0xAE, 0x6B},
                Track(1, "COLOR", truth.color_packing, truth.color_width, truth.color_height) +
                    Track(2, "DEPTH", "b16g", truth.depth_width, truth.depth_height) +
                    Element({0xAE}, Number({0xD7}, 3) + Element({0x53, 0x6E}, "IMU")));
    if (!truth.calibration.empty())
      segment += Element({0x19, 0x41, 0xA4, 0x69},
                         Element({0x61, 0xA7}, Element({0x46, 0x6E}, "calibration.json") +
                                                   Element({0x46, 0x5C}, truth.calibration)));
    segment += Element({0x12, 0x54, 0xC3, 0x67}, Tag("K4A_DEVICE_SERIAL_NUMBER", "000123400412") +
                                                     Tag("K4A_DEPTH_FIRMWARE_VERSION", "1.6.75"));
    for (std::size_t i = 0; i < truth.depths.size(); ++i) {
      // Ticks are microseconds; the clock of the device does not begin at 0.
      std::string cluster = Number({0xE7}, 1'000'000 + 33'333 * i);
      cluster += Block(truth.groups, 1, 250, truth.colors[i % truth.colors.size()]);
      cluster += Block(truth.groups, 2, -350, truth.depths[i]);
      cluster += Block(truth.groups, 3, 0, "any");
      segment += Element({0x1F, 0x43, 0xB6, 0x75}, cluster, truth.known_sizes);
    }
    const std::string file =
        Element({0x1A, 0x45, 0xDF, 0xA3}, Number({0x42, 0x86}, 1) + Number({0x42, 0xF7}, 1) +
                                              Number({0x42, 0xF2}, 4) + Number({0x42, 0xF3}, 8) +
                                              Element({0x42, 0x82}, "matroska") +
                                              Number({0x42, 0x87}, 2) + Number({0x42, 0x85}, 2)) +
        Element({0x18, 0x53, 0x80, 0x67}, segment, truth.known_sizes);
    return {file.begin(), file.end()};
  }

 private:
  static std::string Element(const std::vector<unsigned>& id, const std::string& content,
                             bool is_known = true) {
    std::string element;
    for (const unsigned byte : id) element += static_cast<char>(byte);
    element += '\x01';  // Seven bytes of size follow.
    for (int shift = 48; shift >= 0; shift -= 8)
      element += is_known ? static_cast<char>(content.size() >> shift) : '\xff';
    return element + content;
  }
  static std::string Number(const std::vector<unsigned>& id, std::uint64_t value) {
    std::string bytes;
    do {
      bytes.insert(bytes.begin(), static_cast<char>(value & 0xffU));
      value >>= 8U;
    } while (value != 0);
    return Element(id, bytes);
  }
  static std::string Track(std::uint64_t number, const std::string& name,
                           const std::string& packing, int width, int height) {
    const auto size = [](int side) {
      return std::string{static_cast<char>(side & 0xff), static_cast<char>(side >> 8), 0, 0};
    };
    std::string header = std::string{40, 0, 0, 0} + size(width) + size(height);
    header += std::string{1, 0, 16, 0} + packing + std::string(20, '\0');
    return Element({0xAE},
                   Number({0xD7}, number) + Number({0x73, 0xC5}, number + 70) + Number({0x83}, 1) +
                       Element({0x53, 0x6E}, name) + Element({0x86}, "V_MS/VFW/FOURCC") +
                       Element({0x63, 0xA2}, header) +
                       Element({0xE0}, Number({0xB0}, static_cast<std::uint64_t>(width)) +
                                           Number({0xBA}, static_cast<std::uint64_t>(height))));
  }
  static std::string Tag(const std::string& name, const std::string& value) {
    return Element({0x73, 0x73}, Element({0x63, 0xC0}, "") +
                                     Element({0x67, 0xC8}, Element({0x45, 0xA3}, name) +
                                                               Element({0x44, 0x87}, value)));
  }
  static std::string Block(bool in_group, int track, int ticks, const std::string& data) {
    const std::string block =
        std::string{static_cast<char>(0x80 | track), static_cast<char>((ticks >> 8) & 0xff),
                    static_cast<char>(ticks & 0xff), '\0'} +
        data;
    if (!in_group) return Element({0xA3}, block);
    return Element({0xA0}, Element({0xA1}, block));
  }
};

}  // namespace plumb::testing
