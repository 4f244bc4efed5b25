// SPDX-License-Identifier: Apache-2.0
// Conversion of the services' values to JSON, and of JSON from browsers to values.
#pragma once

#include <ctime>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "algo/base/message.hpp"
#include "web/http/message.hpp"
#include "web/model/account.hpp"
#include "web/model/audit.hpp"
#include "web/model/check.hpp"
#include "web/model/patient.hpp"
#include "web/model/reference.hpp"
#include "web/model/scan.hpp"
#include "web/model/settings.hpp"
#include "web/model/status.hpp"
#include "web/model/wall_clock.hpp"
#include "web/service/scan_service.hpp"

namespace plumb::web {

using Json = nlohmann::ordered_json;

/// "2026-03-01T09:30:00Z"
[[nodiscard]] std::string TimeText(WallClock::time_point time);
/// Takes any year: a certificate's end may be past what a time_point holds.
[[nodiscard]] std::string TimeText(std::time_t time);

}  // namespace plumb::web

/// @cond  Doxygen does not find the scope of these.
// An absent value is null, a time is text.
template <typename T>
struct nlohmann::adl_serializer<std::optional<T>> {
  static void to_json(plumb::web::Json& json, const std::optional<T>& value) {
    if (value)
      json = *value;
    else
      json = nullptr;
  }
};
template <>
struct nlohmann::adl_serializer<plumb::WallClock::time_point> {
  static void to_json(plumb::web::Json& json, plumb::WallClock::time_point time) {
    json = plumb::web::TimeText(time);
  }
};
/// @endcond

namespace plumb {

// These make nlohmann::json convert the values, also in lists and optionals.
void to_json(web::Json& json, const Patient& patient);
void to_json(web::Json& json, const MessageWay& way);
void to_json(web::Json& json, const PlanTemplate& wanted);
void to_json(web::Json& json, const Tolerance& tolerance);
void to_json(web::Json& json, const Reference& reference);
void to_json(web::Json& json, const RoomOnMap& room);
void to_json(web::Json& json, const User& user);  ///< Without the hash.
void to_json(web::Json& json, const AuditEntry& entry);
void to_json(web::Json& json, const UpdateStatus& update);

}  // namespace plumb

namespace plumb::web {

[[nodiscard]] Json ToJson(const Status& status, WallClock::time_point now);
/// @param now  For age_s, so that a page does not rely on its own clock.
[[nodiscard]] Json ToJson(const Scan& scan, WallClock::time_point now);
[[nodiscard]] Json ToJson(const ScanQuality& quality);
[[nodiscard]] Json ToJson(const CheckStatus& checks, WallClock::time_point now);
[[nodiscard]] Json ListJson(const std::vector<Scan>& scans, WallClock::time_point now);
/// Adds KEY with the English sentence, and KEY_message with the message as in message_json.hpp:
/// `absent` and null if it is empty.
void PutMessage(Json& json, const std::string& key, const Message& message,
                const Json& absent = nullptr);
/// Adds KEYs with the English sentences and KEY_messages with the messages, in the same order.
void PutMessages(Json& json, const std::string& key, const std::vector<Message>& messages);
[[nodiscard]] std::string Dump(const Json& json);
[[nodiscard]] Response JsonResponse(const Json& json, int status = 200);

/// The fields of a request's body. Every accessor throws DataError naming the field, what was
/// expected and what was found.
class Fields {
 public:
  /// @throws DataError unless body is one JSON object, nested at most 8 deep.
  explicit Fields(const std::string& body);

  [[nodiscard]] std::string Text(const char* name, std::size_t min, std::size_t max,
                                 bool allow_lines = false);
  [[nodiscard]] double Number(const char* name, double min, double max);
  [[nodiscard]] int Integer(const char* name, int min, int max);
  [[nodiscard]] bool Flag(const char* name);
  /// List of lists of `width` finite numbers, each at most 100 in size; at most `max` of them.
  [[nodiscard]] std::vector<std::vector<double>> Points(const char* name, std::size_t width,
                                                        std::size_t max);
  /// A list of `width` such numbers; nothing if null.
  [[nodiscard]] std::optional<std::vector<double>> Point(const char* name, std::size_t width);
  [[nodiscard]] bool Has(const char* name);
  /// Throws if the body has a field that no accessor asked for.
  void Finish() const;

 private:
  [[nodiscard]] const nlohmann::json& Get(const char* name);

  nlohmann::json json_;
  std::set<std::string> known_;
};

inline constexpr int kMaxRevision = 1'000'000'000;
/// Includes the revision on which it is based.
[[nodiscard]] std::pair<ReferencePlan, int> ParsePlan(const std::string& body);
/// Any of the settings, but at least one.
[[nodiscard]] SettingsChange ParseSettingsChange(const std::string& body);
[[nodiscard]] PlanTemplate ParseTemplate(const std::string& body);
/// With `version`, the one that it replaces.
[[nodiscard]] CouchProfile ReadCouch(Fields& fields);
[[nodiscard]] ScanPurpose ParsePurpose(const std::string& name);

}  // namespace plumb::web
