// What an entry of the audit log is about, in the words that people know: a patient's code instead
// of a row's number.
#pragma once

#include <optional>
#include <string>

#include "daemon/records/database.hpp"
#include "web/model/audit.hpp"

namespace plumb {

/// @returns nothing where the subject is what people know already: an account, a file, no subject.
/// @throws IoError and its kinds
[[nodiscard]] std::optional<AuditSubject> DescribeSubject(Database& database,
                                                          const std::string& action,
                                                          const std::string& subject);

}  // namespace plumb
