// The folder of bundles that wait to be installed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "web/service/change.hpp"

namespace plumb {

[[nodiscard]] web::Change Refused(web::ChangeResult result, std::string message);

/// Files named NAME.raucb. Not thread-safe.
class BundleFolder {
 public:
  using Aside = std::function<bool(std::function<void()>)>;

  /// @param aside  See UpdaterOptions.
  BundleFolder(std::filesystem::path folder, std::uint64_t max_bytes, Aside aside)
      : folder_(std::move(folder)), max_bytes_(max_bytes), aside_(std::move(aside)) {}

  /// Names, sorted; at most 32.
  [[nodiscard]] std::vector<std::string> List() const;
  [[nodiscard]] bool Has(const std::string& name) const;
  /// Moves a file into the folder: kInvalid if it cannot be a bundle, kConflict if there are too
  /// many.
  [[nodiscard]] web::Change Add(const std::filesystem::path& file, const std::string& name) const;
  [[nodiscard]] web::Change Remove(const std::string& name) const;
  /// Removes incomplete uploads from before a power cut.
  void RemoveUnfinished() const;

 private:
  std::filesystem::path folder_;
  std::uint64_t max_bytes_;
  Aside aside_;
};

}  // namespace plumb
