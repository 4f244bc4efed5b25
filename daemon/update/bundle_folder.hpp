// SPDX-License-Identifier: Apache-2.0
// The folder of bundles that wait to be installed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "web/model/change.hpp"

namespace plumb {

inline constexpr std::size_t kMaxListedBundles = 32;

/// Files named NAME.raucb. Add() may wait for the disk for long and belongs on another thread than
/// the loop's; the others do not wait.
class BundleFolder {
 public:
  using RunInBackground = std::function<bool(std::function<void()>)>;

  /// @param run_in_background  See UpdaterOptions.
  BundleFolder(std::filesystem::path folder, std::uint64_t max_bytes,
               RunInBackground run_in_background)
      : folder_(std::move(folder)),
        max_bytes_(max_bytes),
        run_in_background_(std::move(run_in_background)) {}

  /// Names, sorted; at most 32.
  [[nodiscard]] std::vector<std::string> List() const;
  [[nodiscard]] bool Has(const std::string& name) const;
  /// Moves a file into the folder: kInvalid if it cannot be a bundle, kConflict if there are too
  /// many.
  [[nodiscard]] Change Add(const std::filesystem::path& file, const std::string& name) const;
  [[nodiscard]] Change Remove(const std::string& name) const;
  /// Removes any file; large ones are freed in the background. Returns why it could not.
  [[nodiscard]] Message Drop(const std::filesystem::path& file) const;
  /// Removes incomplete uploads from before a power cut.
  void RemoveUnfinished() const;

 private:
  std::filesystem::path folder_;
  std::uint64_t max_bytes_;
  RunInBackground run_in_background_;
};

}  // namespace plumb
