// What can be said of a bundle without RAUC.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace plumb {

/// Empty, or why the file can be no bundle: not a plain file, empty, too large, not a squashfs with
/// a signature behind it. RAUC takes over what it looks at (owner root, readable by root alone): of
/// such a file nothing is said here, nobody can have changed it since.
[[nodiscard]] std::string WhyNoBundle(const std::filesystem::path& file, std::uint64_t max_bytes);

enum class BundleState { kUnknown, kWhole, kDamaged };

/// Whether a bundle still is what was signed: a digest of its contents must be in the signature.
/// Says nothing about who signed it: that is RAUC's to judge, and this only words its refusal.
/// Verity bundles carry their manifest in the signature: there it alone is looked at.
[[nodiscard]] BundleState LookForDamage(const std::filesystem::path& file);

/// True where `a` is an older version than `b`: numbers between dots, compared one by one; what is
/// no number counts as 0.
[[nodiscard]] bool IsOlder(const std::string& a, const std::string& b);

}  // namespace plumb
