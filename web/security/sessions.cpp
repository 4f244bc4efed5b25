// SPDX-License-Identifier: Apache-2.0
#include "web/security/sessions.hpp"

#include <algorithm>

#include "web/security/secrets.hpp"

namespace plumb::web {
namespace {

constexpr std::size_t kMaxSessions = 256;
constexpr std::size_t kMaxOfUser = 16;
constexpr std::size_t kTokenBytes = 32;
constexpr std::size_t kIdBytes = 9;

}  // namespace

bool Sessions::IsOver(const Session& session, TimePoint now) const {
  return session.ended || now - session.last_used >= IdleOf(session.role) ||
         now - session.begun >= whole_;
}

std::chrono::seconds Sessions::IdleOf(Role role) const {
  constexpr std::chrono::minutes kPhysicist{30}, kEngineer{10};
  if (role == Role::kPhysicist) return std::min<std::chrono::seconds>(idle_, kPhysicist);
  if (role == Role::kEngineer) return std::min<std::chrono::seconds>(idle_, kEngineer);
  return idle_;
}

std::vector<std::shared_ptr<Session>> Sessions::Of(const std::string& user) const {
  std::vector<std::shared_ptr<Session>> found;
  for (const auto& [hash, session] : sessions_)
    if (session->user == user) found.push_back(session);
  std::sort(found.begin(), found.end(),
            [](const auto& a, const auto& b) { return a->begun > b->begun; });
  return found;
}

Sessions::Opened Sessions::Open(const User& user, const std::string& address, TimePoint now) {
  Expire(now);
  const auto end_oldest = [](const std::vector<std::shared_ptr<Session>>& of) {
    (*std::min_element(of.begin(), of.end(), [](const auto& a, const auto& b) {
      return a->last_used < b->last_used;
    }))->ended = true;
  };
  if (const auto own = Of(user.name); own.size() >= kMaxOfUser) end_oldest(own);
  if (sessions_.size() >= kMaxSessions) {
    std::vector<std::shared_ptr<Session>> all;
    for (const auto& [hash, session] : sessions_) all.push_back(session);
    end_oldest(all);
  }
  Expire(now);
  Opened opened{
      RandomToken(kTokenBytes),
      std::make_shared<Session>(Session{user.name, user.role, RandomToken(kTokenBytes), now, now})};
  opened.session->id = RandomToken(kIdBytes);
  opened.session->address = address;
  sessions_[HashOf(opened.token)] = opened.session;
  return opened;
}

std::shared_ptr<Session> Sessions::Find(const std::string& token, TimePoint now, bool touch) {
  if (token.empty() || token.size() > 64) return nullptr;
  const auto found = sessions_.find(HashOf(token));
  if (found == sessions_.end()) return nullptr;
  if (IsOver(*found->second, now)) {
    found->second->ended = true;
    sessions_.erase(found);
    return nullptr;
  }
  if (touch) found->second->last_used = now;
  return found->second;
}

void Sessions::End(const std::shared_ptr<Session>& session) {
  session->ended = true;
  std::erase_if(sessions_, [&](const auto& entry) { return entry.second == session; });
}

void Sessions::EndAllOf(const std::string& user, const std::shared_ptr<Session>& but) {
  std::erase_if(sessions_, [&](const auto& entry) {
    if (entry.second->user != user || entry.second == but) return false;
    entry.second->ended = true;
    return true;
  });
}

void Sessions::Expire(TimePoint now) {
  std::erase_if(sessions_, [&](const auto& entry) {
    if (!IsOver(*entry.second, now)) return false;
    entry.second->ended = true;
    return true;
  });
}

void Sessions::SetLimits(std::chrono::seconds idle, std::chrono::seconds whole) {
  idle_ = idle;
  whole_ = whole;
}

}  // namespace plumb::web
