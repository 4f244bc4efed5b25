#include "web/api/routes.hpp"

#include <utility>

#include "algo/base/errors.hpp"
#include "web/api/json.hpp"
#include "web/http/gate.hpp"

namespace plumb::web {

Route& Routes::Read(const char* pattern, Permission permission, Get get) {
  return Add("GET", pattern, permission, BodyKind::kNone,
             [get = std::move(get)](const Request& request, const Respond& respond) {
               respond(get(request));
             });
}

Route& Routes::ReadInBackground(const char* pattern, Permission permission, Get get) {
  return Add("GET", pattern, permission, BodyKind::kNone,
             [&background = background_, name = std::string("GET ") + pattern,
              get = std::move(get)](const Request& request, const Respond& respond) {
               RespondInBackground(
                   background, name, [get, request] { return get(request); }, respond);
             });
}

Route& Routes::Write(const char* method, const char* pattern, Permission permission, BodyKind body,
                     Act act) {
  return Add(method, pattern, permission, body,
             [act = std::move(act)](const Request& request, const Respond& respond) {
               act(request, Answer(respond));
             });
}

Response ChangeResponse(const Change& change) {
  switch (change.result) {
    case ChangeResult::kDone:
      break;
    case ChangeResult::kInvalid:
      return ErrorResponse(400, change.message);
    case ChangeResult::kNotFound:
      return ErrorResponse(404, change.message);
    case ChangeResult::kConflict:
      return ErrorResponse(409, change.message);
    case ChangeResult::kRefused:
      return ErrorResponse(403, change.message);
    case ChangeResult::kNoSpace:
      return ErrorResponse(507, change.message);
    case ChangeResult::kFailed:
      return ErrorResponse(500, change.message);
  }
  Json json = Json::object();
  if (!change.id.empty()) json["id"] = change.id;
  if (!change.message.empty()) json["message"] = change.message;
  return JsonResponse(json, change.id.empty() ? 200 : 201);
}

Done Answer(const Respond& respond) {
  return [respond](const Change& change) { respond(ChangeResponse(change)); };
}

Language LanguageIn(const Request& request) {
  const auto found = request.query.find("language");
  if (found == request.query.end() || found->second == "en") return Language::kEnglish;
  if (found->second == "es") return Language::kSpanish;
  throw DataError("language: expected en or es");
}

}  // namespace plumb::web
