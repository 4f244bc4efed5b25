// `plumb simulate`: whole suites of recordings, with their truth beside them.
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

/// Writes a whole recording to a new .oni file: WriteOni() where there is OpenNI2. Calls `each`
/// after each frame.
using OniWriter =
    std::function<void(const std::filesystem::path& file, FrameSource& source,
                       const std::stop_token& stop, const std::function<void()>& each)>;

struct SimulateOptions {
  /// demo: reference and moved; nine: nine placements, 72 ordered pairs; small: ten placements
  /// within 10 mm and 2 deg, 90 ordered pairs; patient: whole body, deformed.
  std::string suite = "demo";
  std::filesystem::path out;                    ///< Must not exist, or be an empty folder.
  unsigned seed = 1;                            ///< Of room, bodies, placements and hand.
  std::optional<unsigned> unit = std::nullopt;  ///< Of the sensor; none: the same as `seed`.
  simulated::NoiseLevel noise = simulated::NoiseLevel::kNominal;
  std::optional<simulated::FaultSet> faults = std::nullopt;  ///< None: see FaultsOf().
  int frames = 150;  ///< A scene; the sweep lasts frames / rate_hz.
  double rate_hz = 15.0;
  int width = 640;
  int height = 480;
  OniWriter write_oni = {};                        ///< Needed for RecordingFormat::kOni.
  RecordingFormat format = RecordingFormat::kTum;  ///< kOni: lossless files `recordings/NAME.oni`;
                                                   ///< depth in whole millimetres.
};

/// The faults that are on: those of `options`, else all of the noise level; but a demo without a
/// `unit` has the mild ones only, as the virtual sensor has them.
[[nodiscard]] simulated::FaultSet FaultsOf(const SimulateOptions& options);

/// "ideal", "nominal" or "hard".
[[nodiscard]] std::optional<simulated::NoiseLevel> ParseNoiseLevel(std::string_view name);

/// Renders a suite into options.out: suite.json, recordings/NAME/ (TUM RGB-D layout) or
/// recordings/NAME.oni, truth/NAME/. Written beside and renamed at the end: a failure or a stop
/// leaves nothing behind. The same options give the same bytes, whatever the number of threads.
/// @param progress  If set, called on the calling thread with the fraction done and the scene's
/// name.
/// @throws std::invalid_argument for an unknown suite or numbers out of range, DataError if the
/// folder is not empty, IoError if it cannot be
///         written, Interrupted on a stop.
void SimulateSuite(
    const SimulateOptions& options, const std::stop_token& stop = {},
    const std::function<void(double fraction, std::string_view what)>& progress = {});

}  // namespace plumb
