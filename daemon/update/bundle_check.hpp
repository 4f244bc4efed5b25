// Checks of a bundle that do not need RAUC.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace plumb {

/// Empty, or why the file cannot be a bundle: not a regular file, empty, too large, not a squashfs
/// followed by a signature. RAUC takes ownership of files that it has checked (owner root, readable
/// by root only); such a file passes here, because nobody can have changed it since.
[[nodiscard]] std::string WhyNoBundle(const std::filesystem::path& file, std::uint64_t max_bytes);

enum class BundleState { kUnknown, kWhole, kDamaged };

/// Whether a bundle is still what was signed: a digest of its contents must be in the signature.
/// This does not check who signed it, which is RAUC's task, and only explains RAUC's refusal.
/// Verity bundles carry their manifest in the signature, and only the manifest is checked.
[[nodiscard]] BundleState LookForDamage(const std::filesystem::path& file);

/// Empty, or a sentence: the version of a bundle is not of the form that toolchain/image and
/// toolchain/bundle demand, numbers with dots between them, and cannot be compared. A release
/// candidate, say, would pass as the release.
[[nodiscard]] std::string WhyNoVersion(const std::string& version);

/// True if `a` is an older version than `b`: numbers between dots, compared one by one, up to the
/// first other character. A system that runs may have a version of another form and must remain one
/// that can be updated.
[[nodiscard]] bool IsOlder(const std::string& a, const std::string& b);

/// Version of the system that runs: the first word of its release file, as toolchain/image writes
/// it; `program` where there is none. A later system may contain the same program.
[[nodiscard]] std::string VersionOfSystem(const std::filesystem::path& release,
                                          const std::string& program);

}  // namespace plumb
