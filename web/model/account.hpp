// SPDX-License-Identifier: Apache-2.0
// People who log in, and the displays of the room.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "algo/base/names.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb {

/// kDisplay: a paired display in the room, which cannot change anything.
enum class Role { kTechnician, kPhysicist, kEngineer, kDisplay };
template <>
inline constexpr auto kNamesOf<Role> = NamesUpTo<Role::kDisplay>({"technician", "physicist",
                                                                  "engineer", "display"});

/// The user who requests a change; recorded in the audit log.
struct Actor {
  std::string user;     ///< Name of the account.
  std::string address;  ///< Address of the browser.
};

/// A person's choices for the page; empty: the browser's language, the default theme.
struct Preferences {
  std::string language;  ///< Code of a catalogue, such as "en".
  std::string theme;     ///< "dark", "light" or "auto".
};

/// What a person has besides the password: an authenticator, and recovery codes.
struct SecondFactor {
  std::string secret;                        ///< Base32, as the authenticator has it.
  std::int64_t last_step = 0;                ///< Of the last code; none counts twice.
  std::vector<std::string> recovery_hashes;  ///< Of the codes that were not used yet.
  bool operator==(const SecondFactor&) const = default;
};

/// In place of the hash of a password: the clinic's directory knows it.
inline constexpr const char* kInDirectory = "directory";

[[nodiscard]] inline bool IsInDirectory(const std::string& password_hash) {
  return password_hash == kInDirectory;
}

struct User {
  std::string name;
  Role role = Role::kTechnician;
  std::string
      password_hash;  ///< libsodium's argon2id string, or kInDirectory; for the log-in only.
  bool disabled = false;
  WallClock::time_point created_at;
  bool has_second_factor = false;  ///< Read only.
};

/// Changes of an account; fields that are not set stay unchanged.
struct UserChange {
  std::string name;
  std::optional<Role> role;
  std::optional<bool> disabled;
  std::optional<std::string> password_hash;
  /// If set, the change requires that the account is enabled and still has this hash. For users who
  /// change their own password.
  std::optional<std::string> expected_hash;
};

inline constexpr std::size_t kMaxDisplays = 20;

/// A paired display in the room, which cannot change anything.
struct Display {
  std::string id;
  std::string name;
  std::string token_hash;  ///< Hexadecimal; leaves the service only for the login.
  WallClock::time_point paired_at;
  std::string paired_by;
};

}  // namespace plumb
