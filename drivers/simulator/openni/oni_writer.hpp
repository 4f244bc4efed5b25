// SPDX-License-Identifier: Apache-2.0
// Writes frames from any source into an .oni file.
#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>

#include "algo/types/frame.hpp"

namespace plumb {

/// Plays a source to an .oni file and its side-car through the virtual sensor: depth in whole
/// millimetres, stamps in whole microseconds; lossless except for colour as JPEG. Temporarily needs
/// space for the raw frames beside the file. Nothing else in this process may use the virtual
/// sensor meanwhile, and the process should have no other threads that read the environment.
/// @param file      A new file in an existing folder; incomplete ones are removed.
/// @param each      If set, called after each frame taken from the source.
/// @throws IoError, DeviceError, Interrupted; the exceptions of the source.
void WriteOni(const std::filesystem::path& file, FrameSource& source,
              const std::stop_token& stop = {}, const std::function<void()>& each = {},
              bool jpeg = false);

}  // namespace plumb
