#include "daemon/records/audit_subjects.hpp"

#include <algorithm>
#include <array>
#include <string_view>

#include "daemon/records/stored_values.hpp"

namespace plumb {
namespace {

struct Kind {
  std::string_view name;
  /// Its patient's code, number and time by its id; all of them empty where it has none.
  const char* query;
};

constexpr Kind kPatient{"patient", "SELECT code, 0, 0 FROM patients WHERE id = ? AND id > 0"};
constexpr Kind kSession{"session",
                        "SELECT code, fraction, 0 FROM sessions JOIN patients ON patients.id = "
                        "patient_id WHERE sessions.id = ?"};
constexpr Kind kScan{"scan",
                     "SELECT CASE WHEN patient_id > 0 THEN code ELSE '' END, 0, 0 FROM scans JOIN "
                     "patients ON patients.id = patient_id WHERE scans.id = ?"};
constexpr Kind kReference{"reference",
                          "SELECT code, version, 0 FROM refs JOIN patients ON patients.id = "
                          "patient_id WHERE refs.id = ?"};
constexpr Kind kCheck{"check", "SELECT '', 0, time FROM checks WHERE id = ?"};

struct Prefix {
  std::string_view action;  ///< How the actions begin.
  const Kind& kind;
};

// The first one that fits counts.
constexpr std::array kPrefixes = {
    Prefix{"view.patient", kPatient},
    Prefix{"view.reference", kReference},
    Prefix{"view.scan", kScan},
    Prefix{"download.numbers", kPatient},
    Prefix{"download.course", kPatient},
    Prefix{"download.", kScan},
    Prefix{"patient.", kPatient},
    Prefix{"session.", kSession},
    // A scan that begins has no number yet: its patient is known by the session.
    Prefix{"scan.start", kSession},
    Prefix{"scan.end", kSession},
    Prefix{"cancel", kSession},
    Prefix{"scan.", kScan},
    Prefix{"recording.", kScan},
    Prefix{"reference.", kReference},
    Prefix{"check.", kCheck},
};

}  // namespace

std::optional<AuditSubject> DescribeSubject(Database& database, const std::string& action,
                                            const std::string& subject) {
  const auto prefix = std::ranges::find_if(
      kPrefixes, [&](const Prefix& one) { return action.starts_with(one.action); });
  const auto id = ParseId(subject);
  if (prefix == kPrefixes.end() || !id) return std::nullopt;
  AuditSubject about;
  about.kind = prefix->kind.name;
  Statement query = database.Prepare(prefix->kind.query, *id);
  if (!query.Step()) return about;
  about.exists = true;
  about.patient_code = query.Text(0);
  about.number = static_cast<int>(query.Integer(1));
  if (query.Integer(2) > 0) about.time = FromStored(query.Integer(2));
  return about;
}

}  // namespace plumb
