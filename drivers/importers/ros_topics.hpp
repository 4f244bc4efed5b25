// SPDX-License-Identifier: Apache-2.0
// What the names of ROS's topics and frames say of the images, by the conventions of its drivers.
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "algo/base/ascii_lower.hpp"
#include "algo/sensor_model/depth_sensor.hpp"
#include "drivers/replay/device_class.hpp"

namespace plumb {

/// The words of a part of a topic: "image_rect_color" has three.
[[nodiscard]] inline std::vector<std::string_view> WordsOf(std::string_view part) {
  std::vector<std::string_view> words;
  while (!part.empty()) {
    const std::size_t end = std::min(part.find('_'), part.size());
    words.push_back(part.substr(0, end));
    part.remove_prefix(std::min(end + 1, part.size()));
  }
  return words;
}

[[nodiscard]] inline std::string_view LastPart(std::string_view topic) {
  return topic.substr(topic.rfind('/') + 1);
}

/// Whether a driver has put the depth onto the colour image's pixels.
[[nodiscard]] inline bool IsAligned(std::string_view topic) {
  constexpr std::array<std::string_view, 3> kParts = {"/aligned_depth_to_color/",
                                                      "/depth_registered/", "/depth_to_rgb/"};
  return std::ranges::any_of(
      kParts, [&](std::string_view part) { return topic.find(part) != std::string_view::npos; });
}

/// Whether a driver has put the colour onto the depth image's pixels.
[[nodiscard]] inline bool IsColorInDepth(std::string_view topic) {
  return topic.find("/rgb_to_depth/") != std::string_view::npos;
}

/// Whether the image is rectified: it then has the camera P of its camera_info, and no lens.
[[nodiscard]] inline bool IsRectified(std::string_view topic) {
  const std::vector<std::string_view> words = WordsOf(LastPart(topic));
  return std::ranges::find(words, "rect") != words.end() ||
         std::ranges::find(words, "rectified") != words.end();
}

/// Whether the topic is of brightness in infrared light, which has the depth camera's size and
/// numbers of 16 bits, too. The last part that names a kind of image decides: a robot may have any
/// name.
[[nodiscard]] inline bool IsInfrared(std::string_view topic) {
  const auto is_infrared = [](std::string_view word) {
    if (word.starts_with("infra")) return true;
    return word.starts_with("ir") && word.find_first_not_of("0123456789", 2) == word.npos;
  };
  const auto is_other = [](std::string_view word) {
    return word == "depth" || word == "color" || word == "rgb";
  };
  while (!topic.empty()) {
    const std::vector<std::string_view> words = WordsOf(LastPart(topic));
    if (std::ranges::any_of(words, is_other)) return false;
    if (std::ranges::any_of(words, is_infrared)) return true;
    const std::size_t end = topic.rfind('/');
    topic = topic.substr(0, end == topic.npos ? 0 : end);
  }
  return false;
}

/// The class of a depth camera by the name of a topic, of a frame or of a format. Drivers name what
/// they publish by the maker, the model or words of their own.
[[nodiscard]] inline std::optional<DepthSensor> ClassOfRosName(std::string_view name) {
  struct Word {
    std::string_view part;
    DepthSensor sensor;
  };
  constexpr std::array kWords = {
      Word{"l515", DepthSensor::kTimeOfFlight},
      // Of the driver of the Azure Kinect, whose topics have no name in front.
      Word{"depth_to_rgb", DepthSensor::kTimeOfFlight},
      Word{"rgb_to_depth", DepthSensor::kTimeOfFlight},
      Word{"d405", DepthSensor::kActiveStereo},
      Word{"d415", DepthSensor::kActiveStereo},
      Word{"d435", DepthSensor::kActiveStereo},
      Word{"d455", DepthSensor::kActiveStereo},
      Word{"realsense", DepthSensor::kActiveStereo},
      // Of the driver of RealSense: nearly all of its cameras that see a body are of this class.
      Word{"aligned_depth_to_color", DepthSensor::kActiveStereo},
      Word{"openni", DepthSensor::kStructuredLight},
      Word{"freenect", DepthSensor::kStructuredLight},
  };
  if (const auto known = ClassOfDevice(name)) return known;
  const std::string small = AsciiLower(name);
  for (const Word& word : kWords)
    if (small.find(word.part) != std::string::npos) return word.sensor;
  return std::nullopt;
}

}  // namespace plumb
