// SPDX-License-Identifier: Apache-2.0
// A sensor at rest over a body for hours: each still view is rendered once and measured again for
// every frame, with its own noise. Nothing is written.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "algo/base/names.hpp"
#include "algo/types/frame.hpp"
#include "drivers/simulator/suites/planned_scenes.hpp"
#include "drivers/simulator/suites/suite_options.hpp"

namespace plumb {
namespace simulated {

enum class EndlessKind : std::uint8_t {
  kMoves,  ///< The body goes away by a step and comes back, every few seconds; an arm passes.
  kStill,  ///< It only breathes.
  kDrift,  ///< Likewise, while the sensor warms up.
};

/// The body at one frame.
struct EndlessTruth {
  double time_s = 0.0;
  Pose T_world_body = Pose::Identity();
  double belly_m = 0.0;  ///< Above the end of expiration.
};

/// One motion away from the place at the zero, at once.
struct EndlessStep {
  double time_s = 0.0;
  std::string size;  ///< "5 mm", "2 deg".
};

/// Options of a suite from which an EndlessLive can be made.
[[nodiscard]] SimulateOptions EndlessSuite(SimulateOptions options);

/// One breath of four seconds that repeats for ever. Not thread-safe; the same bits for the same
/// arguments.
class EndlessLive : public FrameSource {
 public:
  /// @param plan  Of EndlessSuite(); must live as long as this object.
  EndlessLive(const SuitePlan& plan, EndlessKind kind, double length_s, double rate_hz);

  [[nodiscard]] const StreamInfo& info() const override { return info_; }
  [[nodiscard]] std::optional<Frame> Next() override;
  /// Of the frame that Next() returned last.
  [[nodiscard]] const EndlessTruth& truth() const { return truth_; }
  [[nodiscard]] const std::vector<EndlessStep>& steps() const { return steps_; }
  [[nodiscard]] const Pose& T_world_body() const { return scripts_.front().T_world_body; }

 private:
  /// Where the body lies from a time on, since the start.
  struct Stay {
    double begin_s = 0.0;
    std::size_t place = 0;  ///< Of scripts_.
    bool covered = false;   ///< An arm passes while it goes there.
  };
  struct View {
    DepthView depth;
    double belly_m = 0.0;
  };

  void PlanStays(double length_s);
  [[nodiscard]] const Stay& StayAt(double time_s) const;
  [[nodiscard]] World WorldOf(std::size_t place, double phase_s) const;
  [[nodiscard]] const View& ViewOf(std::size_t place, int phase);
  /// First and last column of an arm that passes, of an image; nothing if there is none.
  [[nodiscard]] std::optional<std::pair<int, int>> ArmAt(double time_s) const;
  [[nodiscard]] double WarmUpAt(double time_s) const;

  const ScenePlan& planned_;
  const SensorUnit& unit_;
  EndlessKind kind_;
  double rate_hz_;
  int num_frames_, num_phases_;
  World world_;
  Trajectory trajectory_;
  ColorCamera color_camera_;
  DepthCamera depth_camera_;
  std::vector<LiveScript> scripts_;  ///< By place: the first is that of the zero.
  std::vector<Stay> stays_;
  std::vector<EndlessStep> steps_;
  std::map<std::pair<std::size_t, int>, View> views_;
  cv::Mat light_, color_;
  StreamInfo info_;
  EndlessTruth truth_;
  int next_ = 0;
};

}  // namespace simulated

template <>
inline constexpr auto kNamesOf<simulated::EndlessKind> =
    NamesUpTo<simulated::EndlessKind::kDrift>({"moves", "still", "drift"});

}  // namespace plumb
