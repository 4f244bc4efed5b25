// SPDX-License-Identifier: Apache-2.0
// Cookies of browsers from which a person has logged in before ("device cookies", OWASP): guesses
// from elsewhere cannot lock such a browser out.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace plumb::web {

/// Creates and verifies them. Nothing is stored: a cookie is a random number with an authentication
/// code over it, the person's name and the hash of the password. It is invalid for another name,
/// with another key, and after a change of password.
class DeviceCookies {
 public:
  /// @param key  32 bytes that outlive a restart; empty: created now, so that cookies become
  ///         invalid with it.
  /// @throws std::invalid_argument for another length.
  DeviceCookies(std::string key, bool tls);

  /// Name of the cookie; one per person, because a browser in a control room is shared.
  [[nodiscard]] std::string NameFor(std::string_view user) const;
  /// The value of a new one.
  [[nodiscard]] std::string Make(std::string_view user, std::string_view password_hash) const;
  /// Identifies a browser, as a key for counting its failures; nothing if the value is not one of
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
