#include "web/security/sessions.hpp"

#include <sodium.h>

#include <algorithm>

#include "algo/base/errors.hpp"

namespace plumb::web {
namespace {

constexpr std::size_t kMaxSessions = 256;
constexpr std::size_t kTokenBytes = 32;

std::string HashOf(const std::string& token) {
  std::string hash(crypto_generichash_BYTES, '\0');
  crypto_generichash(reinterpret_cast<unsigned char*>(hash.data()), hash.size(),
                     reinterpret_cast<const unsigned char*>(token.data()), token.size(), nullptr,
                     0);
  return hash;
}

}  // namespace

std::string RandomBytes(std::size_t bytes) {
  if (sodium_init() < 0) throw IoError("libsodium found no random generator");
  std::string random(bytes, '\0');
  randombytes_buf(random.data(), random.size());
  return random;
}

std::string RandomCode(int letters) {
  constexpr std::string_view kLetters = "23456789ABCDEFGHJKLMNPQRSTUVWXYZ";
  std::string code;
  for (int i = 0; i < letters; ++i) {
    if (i == letters / 2) code += '-';
    code += kLetters[randombytes_uniform(static_cast<std::uint32_t>(kLetters.size()))];
  }
  return code;
}

std::string RandomToken(std::size_t bytes) {
  const std::string random = RandomBytes(bytes);
  std::string text(sodium_base64_ENCODED_LEN(bytes, sodium_base64_VARIANT_URLSAFE_NO_PADDING),
                   '\0');
  sodium_bin2base64(text.data(), text.size(), reinterpret_cast<const unsigned char*>(random.data()),
                    random.size(), sodium_base64_VARIANT_URLSAFE_NO_PADDING);
  text.pop_back();  // its terminating zero
  return text;
}

std::string StoredHashOf(const std::string& token) {
  const std::string hash = HashOf(token);
  std::string text(2 * hash.size() + 1, '\0');
  sodium_bin2hex(text.data(), text.size(), reinterpret_cast<const unsigned char*>(hash.data()),
                 hash.size());
  text.pop_back();  // its terminating zero
  return text;
}

bool Sessions::IsOver(const Session& session, TimePoint now) const {
  return session.ended || now - session.last_used >= idle_ || now - session.begun >= whole_;
}

Sessions::Opened Sessions::Open(const User& user, TimePoint now) {
  Expire(now);
  if (sessions_.size() >= kMaxSessions) {
    const auto oldest = std::min_element(
        sessions_.begin(), sessions_.end(),
        [](const auto& a, const auto& b) { return a.second->last_used < b.second->last_used; });
    oldest->second->ended = true;
    sessions_.erase(oldest);
  }
  Opened opened{
      RandomToken(kTokenBytes),
      std::make_shared<Session>(Session{user.name, user.role, RandomToken(kTokenBytes), now, now})};
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
