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

  [[nodiscard]] virtual CheckStatus GetChecks() = 0;  ///< (aside)
  /// The next scan, from any button, is of the room's markers. kConflict during a scan.
  virtual void OpenCheck(const Actor& actor, Done done) = 0;
  /// From now on checks are compared with this one. kRefused for the person who took it.
  virtual void SetCheckBaseline(const Actor& actor, const std::string& check_id, Done done) = 0;
};

}  // namespace plumb::web
