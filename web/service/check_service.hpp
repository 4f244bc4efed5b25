// The daily check of the room's markers.
#pragma once

#include <string>

#include "web/service/change.hpp"
#include "web/service/service_types.hpp"

namespace plumb::web {

/// The rules of services.hpp hold.
class CheckService {
 public:
  virtual ~CheckService() = default;

  [[nodiscard]] virtual CheckStatus GetChecks() = 0;  ///< (background)
  /// The next scan, from any button, is a check of the room's markers. kConflict during a scan.
  virtual void OpenCheck(const Actor& actor, Done done) = 0;
  /// Sets this check as the baseline. kRefused for the user who took it.
  virtual void SetCheckBaseline(const Actor& actor, const std::string& check_id, Done done) = 0;
};

}  // namespace plumb::web
