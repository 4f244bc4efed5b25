// SPDX-License-Identifier: Apache-2.0
// What a suite of recordings is to contain.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "algo/base/units.hpp"
#include "algo/types/frame.hpp"
#include "drivers/simulator/sensor/sensor_unit.hpp"
#include "drivers/simulator/suites/planning_ct.hpp"
#include "drivers/simulator/suites/unit_lens.hpp"

namespace plumb {

enum class RecordingFormat { kTum, kOni };

/// Writes a complete recording to a new .oni file: WriteOni() if OpenNI2 is available. Calls `each`
/// after each frame.
using OniWriter =
    std::function<void(const std::filesystem::path& file, FrameSource& source,
                       const std::stop_token& stop, const std::function<void()>& each)>;

struct SimulateOptions {
  /// demo: reference and moved; nine: nine placements, 72 ordered pairs; small: ten placements
  /// within 10 mm and 2 deg, 90 ordered pairs; patient: whole body, deformed; ct: the placements of
  /// small, each compared with a planning CT in four positions, 40 pairs;
  /// live: two sweeps, and a sensor at rest over the body of the second.
  std::string suite = "demo";
  std::filesystem::path out;  ///< Must not exist, or be an empty folder.
  unsigned seed = 1;          ///< Of room, bodies, placements and hand.
  /// Seed of the sensor; not set: the same as `seed`.
  std::optional<unsigned> unit = std::nullopt;
  /// Seed of markers, floor, hand and noise, and of the sensor without a `unit`; not set: the same
  /// as `seed`. With it the bodies and placements of `seed` are seen in another room.
  std::optional<unsigned> room = std::nullopt;
  simulated::NoiseLevel noise = simulated::NoiseLevel::kNominal;
  std::optional<simulated::FaultSet> faults = std::nullopt;  ///< Not set: see FaultsOf().
  DepthSensor sensor = DepthSensor::kStructuredLight;        ///< Class of the depth camera.
  simulated::LensKind lens = simulated::LensKind::kPlain;    ///< Of the colour camera.
  double ct_spacing_m = 3 * kMillimetre;                     ///< Of the slices of the suite `ct`.
  /// Standard deviation of how far its contours lie outside the skin, which no file states.
  double ct_skin_m = 0.0;
  bool ct_images = false;  ///< Its CTs are images on a couch, without a structure set.
  std::vector<simulated::CtQuirk> ct_quirks = {};  ///< Of its files.
  int frames = 150;                                ///< Per scene; the sweep lasts frames / rate_hz.
  double rate_hz = 15.0;
  double live_s = 36.0;                ///< Length of the recordings of a sensor at rest.
  std::vector<std::string> live = {};  ///< Which of them; empty: all.
  int width = 640;
  int height = 480;
  OniWriter write_oni = {};  ///< Required for RecordingFormat::kOni.
  /// kOni: lossless files `recordings/NAME.oni` with depth in whole millimetres.
  RecordingFormat format = RecordingFormat::kTum;
};

/// The active faults: those of `options`, otherwise all of the noise level. A demo without a `unit`
/// has only the mild ones, like the virtual sensor.
[[nodiscard]] simulated::FaultSet FaultsOf(const SimulateOptions& options);

}  // namespace plumb
