// `plumb simulate`: whole suites of recordings, with their truth beside them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>

#include "drivers/simulated/sensor_unit.hpp"

namespace plumb {

enum class RecordingFormat { kTum, kOni };

struct SimulateOptions {
  std::string suite = "demo";  ///< demo: reference and moved; nine: nine placements, 72 ordered pairs; patient: whole body, deformed.
  std::filesystem::path out;   ///< Must not exist, or be an empty folder.
  unsigned seed = 1;
  simulated::NoiseLevel noise = simulated::NoiseLevel::kNominal;
  int frames = 150;  ///< A scene; the sweep lasts frames / rate_hz.
  double rate_hz = 15.0;
  int width = 640;
  int height = 480;
  RecordingFormat format = RecordingFormat::kTum;  ///< kOni: lossless files `recordings/NAME.oni`; depth in whole millimetres.
};

/// "ideal", "nominal" or "hard".
[[nodiscard]] std::optional<simulated::NoiseLevel> ParseNoiseLevel(std::string_view name);

/// Renders a suite into options.out: suite.json, recordings/NAME/ (TUM RGB-D layout) or recordings/NAME.oni, truth/NAME/. Written beside
/// and renamed at the end: a failure or a stop leaves nothing behind. The same options give the same bytes, whatever the number of threads.
/// @param progress  If set, called on the calling thread with the fraction done and the scene's name.
/// @throws std::invalid_argument for an unknown suite or numbers out of range, DataError if the folder is not empty, IoError if it cannot
/// be
///         written, Interrupted on a stop.
void SimulateSuite(const SimulateOptions& options, const std::stop_token& stop = {},
                   const std::function<void(double fraction, std::string_view what)>& progress = {});

}  // namespace plumb
