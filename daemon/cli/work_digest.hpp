// SPDX-License-Identifier: Apache-2.0
// Names of outputs by what they are made of: the same work has the same name.
#pragma once

#include <filesystem>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>

#include "algo/base/names.hpp"
#include "daemon/config/config.hpp"

namespace plumb {

/// SHA-256 over the names, sizes and contents of all files in a folder and its subfolders, or of
/// one file. The name and place of the input itself do not count, but a file's extension does.
/// @throws DataError if there is no such input, or it cannot be read; Interrupted
[[nodiscard]] std::string ContentDigest(const std::filesystem::path& input,
                                        const std::stop_token& stop);

/// Everything but the inputs that decides the outcome of a command, as text: the command, the
/// version, the preset and what the configuration gives in the sections that the command uses.
[[nodiscard]] std::string MethodText(std::string_view command, const Config& config,
                                     std::span<const std::string_view> sections);
/// A further option, or a file that one names.
[[nodiscard]] std::string OptionText(std::string_view option, std::string_view value);

/// The name of an output folder: 32 hexadecimal digits.
[[nodiscard]] std::string WorkName(std::string_view method,
                                   std::span<const std::filesystem::path> inputs,
                                   const std::stop_token& stop);

}  // namespace plumb
