// SPDX-License-Identifier: Apache-2.0
// Recordings of k4arecorder, of an Azure Kinect or, through Orbbec's wrapper, of a Femto: Matroska
// with a track of colour, one of depth, and the device's calibration as an attachment.
#pragma once

#include <memory>

#include "drivers/importers/recorded_file.hpp"

namespace plumb {

/// Colour as JPEG, NV12 or YUY2; depth in millimetres of its own camera; both lenses with eight
/// coefficients; stamps of the middle of the exposure, as the device makes them.
/// @throws DataError for a damaged file and for films without such tracks.
[[nodiscard]] std::unique_ptr<RecordedFile> OpenAzureMkv(FileBytes bytes);

}  // namespace plumb
