// SPDX-License-Identifier: Apache-2.0
// Checks of a bundle that do not need RAUC.
#pragma once

#include <cstdint>
#include <filesystem>
#include <stop_token>
#include <string>
#include <string_view>

#include "algo/base/message.hpp"

namespace plumb {

/// NAME.raucb: plain letters without folders, no option, hidden file or address.
[[nodiscard]] bool IsBundleName(std::string_view name);

/// Bytes of a bundle's signature at most.
inline constexpr std::uint64_t kMaxSignature = 64 << 10;

/// Empty, or why the file cannot be a bundle: not a regular file, empty, too large, not a squashfs
/// followed by a signature. RAUC takes ownership of files that it has checked (owner root, readable
/// by root only); such a file passes here, because nobody can have changed it since.
/// @param name  Of the bundle in the message: an upload has another one than its file.
[[nodiscard]] Message WhyNoBundle(const std::filesystem::path& file, std::uint64_t max_bytes,
                                  const std::string& name);

/// As people read the size of a file, rounded down.
[[nodiscard]] inline double WholeMegabytes(std::uint64_t bytes) {
  return static_cast<double>(bytes >> 20);
}

enum class BundleState { kUnknown, kWhole, kDamaged };

/// Whether a bundle is still what was signed: a digest of its contents must be in the signature.
/// This does not check who signed it, which is RAUC's task, and only explains RAUC's refusal.
/// Verity bundles carry their manifest in the signature, and only the manifest is checked.
/// kUnknown on a stop request.
[[nodiscard]] BundleState LookForDamage(const std::filesystem::path& file,
                                        const std::stop_token& stop = {});

/// Empty if a version consists of numbers separated by dots, as toolchain/image and
/// toolchain/bundle require; otherwise why not. Other versions cannot be compared: a release
/// candidate, for example, would count as the release.
[[nodiscard]] Message WhyNoVersion(const std::string& version);

/// True if `a` is older than `b`. The numbers between the dots are compared one by one, up to the
/// first other character: the version of the running system may have another form, and the system
/// must still accept updates.
[[nodiscard]] bool IsOlder(const std::string& a, const std::string& b);

/// Version of the system that runs: the first word of its release file, as toolchain/image writes
/// it; `program` where there is none. A later system may contain the same program.
[[nodiscard]] std::string VersionOfSystem(const std::filesystem::path& release,
                                          const std::string& program);

}  // namespace plumb
