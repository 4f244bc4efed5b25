// SPDX-License-Identifier: Apache-2.0
// What the sweeps of plumb_web_test_server show: scenes, and the real results of comparing them.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "algo/comparison/comparison.hpp"
#include "tests/support/fake_appliance.hpp"
#include "tests/support/synthetic_scene.hpp"

namespace plumb::test {

/// The couch lies along the marker's x axis, its head end at the gantry.
extern const Pose kT_iec_reference;

inline constexpr int kNumSweeps = 4;

/// What the sweeps show in turn: a body, carried, lying right, with its markers covered.
[[nodiscard]] SyntheticOptions Sweep(int number);
/// A body that lies right.
[[nodiscard]] SyntheticOptions LyingRight(unsigned seed);
/// Another person in the place of the one of the reference.
[[nodiscard]] SyntheticOptions Stranger();
/// The body lies right, but its left side is lifted at the head end.
[[nodiscard]] SyntheticOptions LiftedShoulder();
/// A square of 12 cm on the body was not swept over.
[[nodiscard]] SyntheticOptions WithHole();

class Recorder {
 public:
  explicit Recorder(std::filesystem::path root) : root_(std::move(root)) {}

  /// The first one is the reference of all others.
  FakeAppliance::Recorded Record(const SyntheticOptions& options);
  /// As Record(), but only the first time that something of this name is shown.
  FakeAppliance::Recorded Once(const std::string& name,
                               const std::function<SyntheticOptions()>& options);
  /// As Record(), of a scene that something was done to.
  FakeAppliance::Recorded RecordChanged(const SyntheticOptions& options,
                                        const std::function<void(Scene&)>& change);
  /// A motion whose roll the surface hardly determines.
  FakeAppliance::Recorded RecordWeak();
  /// A moved body, in a room whose axes are turned by 90 degrees: the plan's posture is not its
  /// own.
  FakeAppliance::Recorded RecordAcross();
  /// A result of which the body's motion in the room is known: along an axis (mm), or about it
  /// (degrees). "x" is to the right of who faces the gantry, "y" to the gantry, "z" up; "pitch",
  /// "roll", "yaw" are turns about them.
  FakeAppliance::Recorded RecordMotion(const std::string& axis, double amount,
                                       const std::string& posture, bool is_room_known = true);

  [[nodiscard]] const Scene& reference() const { return *reference_; }

 private:
  std::filesystem::path NewFolder();
  FakeAppliance::Recorded Write(const std::filesystem::path& folder, const Comparison& comparison);
  /// Of a body that did not move, on the scene of the first sweep.
  const Comparison& Still();
  FakeAppliance::Recorded WriteOfFirst(const Comparison& comparison);

  std::filesystem::path root_;
  int num_folders_ = 0;
  std::optional<Scene> reference_;
  std::optional<Comparison> still_;
  std::map<std::string, FakeAppliance::Recorded> made_;  ///< By the name of what they show.
};

/// What a sweep from low to high x has seen of the body after that share of it, as plumbd packs it.
[[nodiscard]] std::string SurfaceAt(const Scene& scene, double share, bool has_region);

}  // namespace plumb::test
