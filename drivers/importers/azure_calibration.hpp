// SPDX-License-Identifier: Apache-2.0
// The calibration that an Azure Kinect or a Femto keeps, as the keys of camera.yaml.
#pragma once

#include <string_view>

#include <nlohmann/json.hpp>

namespace plumb {

/// Sizes of the recorded images: what the device cut out of its sensors' images and binned follows
/// from them.
struct AzureSizes {
  int color_width = 0, color_height = 0, depth_width = 0, depth_height = 0;
};

/// @throws DataError if the text is damaged or states another lens, and for other sizes than the
///         device's modes have.
[[nodiscard]] nlohmann::ordered_json AzureCamera(std::string_view calibration,
                                                 const AzureSizes& sizes);

}  // namespace plumb
