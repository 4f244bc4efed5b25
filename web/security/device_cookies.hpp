// Cookies of browsers from which a person has logged in before ("device cookies", OWASP): guesses
// from elsewhere cannot lock such a browser out.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace plumb::web {

/// Makes and checks them. Nothing is stored: a cookie is a random number with a code of
/// authentication over it, the person's name and the hash of the password. It is worthless for
/// another name, with another key, and once the password has been changed.
class DeviceCookies {
 public:
  /// @param key  32 bytes that outlive a restart; empty: made now, so that cookies end with it.
  /// @throws std::invalid_argument for another length.
  DeviceCookies(std::string key, bool tls);

  /// Of the cookie; one for each person, because a browser in a control room is shared.
  [[nodiscard]] std::string NameFor(std::string_view user) const;
  /// The value of a new one.
  [[nodiscard]] std::string Make(std::string_view user, std::string_view password_hash) const;
  /// Which browser this is, as a key for counting its failures; nothing if the value is not one of
  /// ours.
  [[nodiscard]] std::optional<std::string> Identify(std::string_view value, std::string_view user,
                                                    std::string_view password_hash) const;

 private:
  [[nodiscard]] std::string CodeOf(std::string_view number, std::string_view user,
                                   std::string_view password_hash) const;

  std::string key_;
  bool tls_;
};

}  // namespace plumb::web
