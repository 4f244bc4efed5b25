#include "web/api/displays.hpp"

#include <algorithm>
#include <functional>
#include <utility>

#include "web/api/json.hpp"
#include "web/http/checks.hpp"
#include "web/model/account.hpp"
#include "web/model/limits.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb::web {
namespace {

constexpr std::size_t kMaxWaiting = 8;
constexpr std::chrono::minutes kWaitsFor{10};
constexpr std::chrono::seconds kReloadInterval{5};
constexpr int kMaxWrongCodes = 20;
/// The longest that browsers keep a cookie; it is renewed at each use.
constexpr std::chrono::hours kCookieAge{400 * 24};

}  // namespace

Displays::Displays(DisplayService& service, bool tls, std::function<TimePoint()> now)
    : service_(service), tls_(tls), now_(std::move(now)) {
  Load();
}

/// Sessions of removed displays end at once, and so do their streams.
void Displays::Load() {
  std::map<std::string, std::shared_ptr<Session>> sessions;
  for (const Display& display : service_.Displays()) {
    auto& session = sessions[display.token_hash];
    const auto known = sessions_.find(display.token_hash);
    session = known != sessions_.end()
                  ? known->second
                  : std::make_shared<Session>(Session{"display " + display.name, Role::kDisplay,
                                                      RandomToken(32), now_(), now_()});
  }
  for (const auto& [hash, session] : sessions_) session->ended = !sessions.contains(hash);
  sessions_ = std::move(sessions);
  loaded_ = now_();
}

std::shared_ptr<Session> Displays::SessionOf(const Request& request) {
  const auto token = CookieValue(request.Header("cookie"), cookie_name());
  if (!token || token->empty() || token->size() > 64) return nullptr;
  // A database that could not be opened at the start may have been opened since.
  if (sessions_.empty() && now_() - loaded_ >= kReloadInterval) Load();
  const auto found = sessions_.find(StoredHashOf(*token));
  return found == sessions_.end() ? nullptr : found->second;
}

void Displays::Expire() {
  std::erase_if(pairings_,
                [&](const Pairing& pairing) { return now_() - pairing.begun > kWaitsFor; });
  if (pairings_.empty()) wrong_codes_ = 0;
}

void Displays::AddRoutes(Routes& routes) {
  routes.Read("/api/v1/displays", Permission::kUsers, [this](const Request&) { return List(); });
  const auto add = [&](const char* method, const char* pattern, Permission permission,
                       BodyKind body, auto handler) {
    routes.Add(method, pattern, permission, body, std::bind_front(handler, this));
  };
  add("POST", "/api/v1/displays/pair", Permission::kNone, BodyKind::kNone, &Displays::Begin);
  add("POST", "/api/v1/displays/claim", Permission::kNone, BodyKind::kJson, &Displays::Claim);
  add("POST", "/api/v1/displays", Permission::kUsers, BodyKind::kJson, &Displays::Approve);
  add("DELETE", "/api/v1/displays/{id}", Permission::kUsers, BodyKind::kNone, &Displays::Remove);
}

void Displays::Begin(const Request&, const Respond& respond) {
  Expire();
  if (pairings_.size() >= kMaxWaiting)
    return respond(
        ErrorResponse(503, "too many screens are waiting to be paired; try again later"));
  const std::string token = RandomToken(32);
  pairings_.push_back({.code = RandomCode(6), .token_hash = StoredHashOf(token), .begun = now_()});
  respond(JsonResponse({{"code", pairings_.back().code}, {"secret", token}}));
}

void Displays::Claim(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const std::string token = fields.Text("secret", 1, 64);
  fields.Finish();
  Expire();
  const std::string hash = StoredHashOf(token);
  if (sessions_.contains(hash)) {
    Response response = JsonResponse({{"paired", true}});
    SetCookie(response, cookie_name(), token, tls_, kCookieAge);
    return respond(std::move(response));
  }
  const bool waits = std::any_of(pairings_.begin(), pairings_.end(), [&](const Pairing& pairing) {
    return pairing.token_hash == hash;
  });
  if (!waits) return respond(ErrorResponse(404, "this pairing has expired: start again"));
  respond(JsonResponse({{"paired", false}}));
}

void Displays::Approve(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  std::string code = fields.Text("code", 1, 16);
  const std::string name = fields.Text("name", 1, kMaxName);
  fields.Finish();
  Expire();
  std::transform(code.begin(), code.end(), code.begin(),
                 [](char c) { return c >= 'a' && c <= 'z' ? static_cast<char>(c - 32) : c; });
  const auto found = std::find_if(pairings_.begin(), pairings_.end(),
                                  [&](const Pairing& pairing) { return pairing.code == code; });
  if (found == pairings_.end()) {
    if (++wrong_codes_ > kMaxWrongCodes) pairings_.clear();
    return respond(ErrorResponse(404, "no screen shows this code; a code is valid for 10 minutes"));
  }
  static_assert(kMaxDisplays == 20);  // The page translates the sentence with its number.
  if (service_.Displays().size() >= kMaxDisplays)
    return respond(ErrorResponse(409, "20 screens are paired already: remove one first"));
  const Display display{.id = {},
                        .name = name,
                        .token_hash = found->token_hash,
                        .paired_at = WallClock::now(),
                        .paired_by = request.actor().user};
  pairings_.erase(found);
  service_.AddDisplay(request.actor(), display, LoadThenAnswer(respond));
}

Response Displays::List() {
  Json list = Json::array();
  for (const Display& display : service_.Displays()) {
    list.push_back(Json{{"id", display.id},
                        {"name", display.name},
                        {"paired_at", display.paired_at},
                        {"paired_by", display.paired_by}});
  }
  return JsonResponse({{"displays", list}});
}

void Displays::Remove(const Request& request, const Respond& respond) {
  service_.RemoveDisplay(request.actor(), request.arguments.at(0), LoadThenAnswer(respond));
}

Done Displays::LoadThenAnswer(const Respond& respond) {
  return [this, alive = std::weak_ptr(alive_), respond](const Change& change) {
    if (alive.expired()) return;
    Load();
    respond(ChangeResponse(change));
  };
}

}  // namespace plumb::web
