// SPDX-License-Identifier: Apache-2.0
// `plumb simulate`: complete suites of recordings with their true values.
#pragma once

#include <functional>
#include <stop_token>
#include <string_view>

#include "drivers/simulator/suites/suite_options.hpp"

namespace plumb {

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
