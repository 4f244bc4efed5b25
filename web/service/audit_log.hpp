// Who did what, and when.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "web/service/service_types.hpp"

namespace plumb::web {

/// The rules of services.hpp hold.
class AuditLog {
 public:
  virtual ~AuditLog() = default;

  /// Logins and what else is no change of the store. May be written later, in order.
  virtual void Log(const Actor& actor, const std::string& action, const std::string& subject,
                   const std::string& detail) = 0;
  /// Newest first, older than number `before` (0: all) (aside).
  [[nodiscard]] virtual std::vector<AuditEntry> Audit(std::int64_t before, int limit) = 0;
};

}  // namespace plumb::web
