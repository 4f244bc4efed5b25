// Frames from anywhere into an .oni file.
#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>

#include "algo/types/frame.hpp"

namespace plumb {

/// Plays a source to an .oni file and its side-car, lossless, through the virtual sensor: depth in
/// whole millimetres, stamps in whole microseconds. Needs room for the raw frames beside the file
/// while it works. Nothing else may use the virtual sensor in this process meanwhile, and the
/// process should have no other threads that read the environment.
/// @param file      A new file, in a folder that exists; half-written ones are removed.
/// @param each      If set, called after each frame taken from the source.
/// @throws IoError, DeviceError, Interrupted; what the source throws.
void WriteOni(const std::filesystem::path& file, FrameSource& source,
              const std::stop_token& stop = {}, const std::function<void()>& each = {});

}  // namespace plumb
