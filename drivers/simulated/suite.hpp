// `plumb simulate`: complete suites of recordings with their true values.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>

#include "algo/types/frame.hpp"
#include "drivers/simulated/sensor_unit.hpp"

namespace plumb {

enum class RecordingFormat { kTum, kOni };

/// Writes a complete recording to a new .oni file: WriteOni() if OpenNI2 is available. Calls `each`
/// after each frame.
using OniWriter =
    std::function<void(const std::filesystem::path& file, FrameSource& source,
                       const std::stop_token& stop, const std::function<void()>& each)>;

struct SimulateOptions {
  /// demo: reference and moved; nine: nine placements, 72 ordered pairs; small: ten placements
  /// within 10 mm and 2 deg, 90 ordered pairs; patient: whole body, deformed.
  std::string suite = "demo";
  std::filesystem::path out;  ///< Must not exist, or be an empty folder.
  unsigned seed = 1;          ///< Of room, bodies, placements and hand.
  /// Seed of the sensor; not set: the same as `seed`.
  std::optional<unsigned> unit = std::nullopt;
  simulated::NoiseLevel noise = simulated::NoiseLevel::kNominal;
  std::optional<simulated::FaultSet> faults = std::nullopt;  ///< Not set: see FaultsOf().
  int frames = 150;  ///< Per scene; the sweep lasts frames / rate_hz.
  double rate_hz = 15.0;
  int width = 640;
  int height = 480;
  OniWriter write_oni = {};  ///< Required for RecordingFormat::kOni.
  /// kOni: lossless files `recordings/NAME.oni` with depth in whole millimetres.
  RecordingFormat format = RecordingFormat::kTum;
};

/// The active faults: those of `options`, otherwise all of the noise level. A demo without a `unit`
/// has only the mild ones, like the virtual sensor.
[[nodiscard]] simulated::FaultSet FaultsOf(const SimulateOptions& options);

/// Renders a suite into options.out: suite.json, recordings/NAME/ (TUM RGB-D layout) or
/// recordings/NAME.oni, truth/NAME/. It is written beside the final path and renamed at the end, so
/// that a failure or a stop leaves nothing behind. The same options give the same bytes on any
/// number of threads.
/// @param progress  If set, called on the calling thread with the completed fraction and the
///         scene's name.
/// @throws std::invalid_argument for an unknown suite or numbers out of range, DataError if the
///         folder is not empty, IoError if it cannot be written, Interrupted on a stop request.
void SimulateSuite(
    const SimulateOptions& options, const std::stop_token& stop = {},
    const std::function<void(double fraction, std::string_view what)>& progress = {});

}  // namespace plumb
