// SPDX-License-Identifier: Apache-2.0
#include "daemon/cli/work_digest.hpp"

#include <algorithm>
#include <vector>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/config/version.hpp"
#include "daemon/scan_files/scan_files.hpp"
#include "words/cli.hpp"
#include "words/file.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

/// Of an hour at 30 Hz, four times over.
constexpr std::size_t kMaxInputFiles = 1'000'000;
constexpr std::size_t kNameDigits = 32;

/// Relative to the folder, in an order that no file system decides.
std::vector<std::string> FilesBelow(const fs::path& folder) {
  std::vector<std::string> files;
  for (const fs::directory_entry& entry :
       fs::recursive_directory_iterator(folder, fs::directory_options::follow_directory_symlink)) {
    std::error_code ignored;
    if (entry.is_regular_file(ignored))
      files.push_back(entry.path().lexically_relative(folder).string());
    if (files.size() > kMaxInputFiles)
      throw DataError(
          say::cli::InputTooLarge(folder.string(), static_cast<std::int64_t>(kMaxInputFiles)));
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// The length of the name stands before it, so that no name can look like another line.
std::string LineOf(const FileDigest& file, std::string_view name) {
  return fmt::format("{} {} {} {}\n", file.sha256, file.bytes, name.size(), name);
}

}  // namespace

std::string ContentDigest(const fs::path& input, const std::stop_token& stop) {
  Sha256 all;
  const auto add = [&](const std::string& line) { all.Add(line.data(), line.size()); };
  try {
    if (fs::is_directory(input)) {
      for (const std::string& file : FilesBelow(input))
        add(LineOf(DigestOfFile(input, file, stop), file));
    } else if (fs::is_regular_file(input)) {
      add(LineOf(DigestOfFile(input.parent_path(), input.filename().string(), stop),
                 input.extension().string()));
    } else {
      throw DataError(say::cli::NoInput(input.string()));
    }
  } catch (const IoError& error) {
    throw DataError(error.message());  // It is the input that cannot be read.
  } catch (const fs::filesystem_error& error) {
    throw DataError(say::file::CannotRead(input.string(), error.code().message()));
  }
  return all.Hex();
}

std::string OptionText(std::string_view option, std::string_view value) {
  return fmt::format("{} {} {}\n", option, value.size(), value);
}

std::string MethodText(std::string_view command, const Config& config,
                       std::span<const std::string_view> sections) {
  std::string text = OptionText("command", command) + OptionText("version", Version()) +
                     OptionText("preset", Name(config.compare.preset)) +
                     OptionText("reconstruct", Name(config.reconstruct.preset));
  for (const auto& [key, value] : config.given) {
    const std::string_view section = std::string_view(key).substr(0, key.find('.'));
    if (std::find(sections.begin(), sections.end(), section) != sections.end())
      text += OptionText(key, value);
  }
  return text;
}

std::string WorkName(std::string_view method, std::span<const fs::path> inputs,
                     const std::stop_token& stop) {
  std::string text(method);
  for (const fs::path& input : inputs) text += OptionText("input", ContentDigest(input, stop));
  return Sha256Of(text).substr(0, kNameDigits);
}

}  // namespace plumb
