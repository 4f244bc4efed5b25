// SPDX-License-Identifier: Apache-2.0
#include "daemon/unit/page_identity.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <functional>
#include <stdexcept>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "drivers/files/descriptor.hpp"
#include "drivers/files/file_io.hpp"
#include "web/http/listen_socket.hpp"
#include "web/security/secrets.hpp"
#include "words/upkeep.hpp"
#include "words/web.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
constexpr std::size_t kMaxPemBytes = 64 << 10;
// certificate and key together, so that they always match
constexpr const char* kKeyFile = "page-key.pem";
constexpr const char* kAuthorityFile = "page-authority.pem";
constexpr const char* kDeviceFile = "device.key";

void Sync(const fs::path& path, int flags) {
  const Descriptor opened(::open(path.c_str(), flags | O_CLOEXEC));
  if (opened.get() < 0 || ::fsync(opened.get()) != 0)
    throw IoError(DescribeWriteError(path, errno));
}

void WriteSecret(const fs::path& file, const std::string& contents) {
  const fs::path hidden = file.parent_path() / fmt::format(".{}.new", file.filename().string());
  ::unlink(hidden.c_str());  // left by an interrupted start
  {
    const Descriptor opened(
        ::open(hidden.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600));
    if (opened.get() < 0) throw IoError(DescribeWriteError(hidden, errno));
    WriteAll(opened, contents, hidden);
    if (::fchmod(opened.get(), 0600) != 0 || ::fsync(opened.get()) != 0)
      throw IoError(DescribeWriteError(hidden, errno));
  }
  if (::rename(hidden.c_str(), file.c_str()) != 0) throw IoError(DescribeWriteError(file, errno));
  Sync(file.parent_path(), O_RDONLY | O_DIRECTORY);
}

web::TlsIdentity GivenTls(const WebConfig& web) {
  const Message name =
      say::upkeep::GivenCertificate(web.tls_certificate.string(), web.tls_key.string());
  return web::CheckedTlsIdentity(ReadTextFile(web.tls_certificate, kMaxPemBytes),
                                 ReadTextFile(web.tls_key, kMaxPemBytes), name);
}

/// By the authority of this unit, which is made if there is none, or if the one that there is could
/// not sign what is needed now: because the unit has another name, or because its clock was wrong.
web::TlsIdentity Issued(const fs::path& state, const std::vector<std::string>& names,
                        std::chrono::system_clock::time_point now) {
  const fs::path file = state / kAuthorityFile;
  const auto make = [&] { return web::MakeAuthority(names, now); };
  std::string authority = ReadOrMakeSecret(file, make);
  if (!web::CanIssue(authority, names, now)) {
    authority = make();
    WriteSecret(file, authority);
  }
  return web::IssueTlsIdentity(authority, names, now);
}

web::TlsIdentity OwnTls(const Config& config, std::vector<Message>& warnings) {
  const fs::path file = config.appliance.state / kKeyFile;
  try {
    const std::string pem = ReadOrMakeSecret(file, [&] {
      const web::TlsIdentity made =
          Issued(config.appliance.state, config.web.host_names, std::chrono::system_clock::now());
      return made.certificate_pem + made.key_pem;
    });
    return web::CheckedTlsIdentity(pem, pem, say::web::FileNamed(file.string()));
  } catch (const std::runtime_error& error) {
    warnings.push_back(say::upkeep::CertificateForThisRun(MessageOf(error)));
  }
  return web::MakeTlsIdentity(config.web.host_names);
}

std::string DeviceKey(const Config& config, std::vector<Message>& warnings) {
  constexpr std::size_t kBytes = 32;
  const fs::path file = config.appliance.state / kDeviceFile;
  try {
    std::string key = ReadOrMakeSecret(file, [] { return web::RandomBytes(kBytes); });
    if (key.size() == kBytes) return key;
    warnings.push_back(
        say::upkeep::DeviceKeySize(file.string(), static_cast<std::int64_t>(key.size()), kBytes));
  } catch (const std::runtime_error& error) {
    warnings.push_back(say::upkeep::DeviceKeyLost(MessageOf(error)));
  }
  return {};
}

}  // namespace

std::string ReadOrMakeSecret(const fs::path& file, const std::function<std::string()>& make) {
  std::error_code error;
  const fs::file_status status = fs::symlink_status(file, error);
  if (status.type() == fs::file_type::not_found) {
    const std::string contents = make();
    WriteSecret(file, contents);
    return contents;
  }
  if (status.type() != fs::file_type::regular)
    throw DataError(error ? say::upkeep::NotAFileBecause(file.string(), error.message())
                          : say::upkeep::NotAFile(file.string()));
  ::chmod(file.c_str(), 0600);  // a copy of the folder may have lost the mode
  return ReadTextFile(file, kMaxPemBytes);
}

void KeepSecret(const fs::path& file, const std::string& contents) {
  WriteSecret(file, contents);
  struct stat folder {};
  if (::geteuid() == 0 && (::stat(file.parent_path().c_str(), &folder) != 0 ||
                           ::lchown(file.c_str(), folder.st_uid, folder.st_gid) != 0))
    throw IoError(DescribeWriteError(file, errno));
}

void KeepPageIdentity(const fs::path& state, const web::TlsIdentity& identity) {
  KeepSecret(state / kKeyFile, fmt::format("{}\n{}", identity.certificate_pem, identity.key_pem));
}

std::string AccessToken(const fs::path& file) {
  if (file.empty()) return {};
  constexpr std::size_t kMinToken = 32, kMaxToken = 256;
  std::string token = ReadTextFile(file, 2 * kMaxToken);
  while (!token.empty() && std::isspace(static_cast<unsigned char>(token.back())) != 0)
    token.pop_back();
  const bool is_plain = std::ranges::all_of(
      token, [](unsigned char c) { return std::isalnum(c) != 0 || c == '-' || c == '_'; });
  if (!is_plain || token.size() < kMinToken || token.size() > kMaxToken)
    throw DataError(say::upkeep::MetricsTokenUnusable(file.string(), static_cast<int>(kMinToken),
                                                      static_cast<int>(kMaxToken)));
  return token;
}

void CheckPageIdentity(const WebConfig& web) {
  (void)AccessToken(web.metrics_token_file);
  if (TransportOf(web, /*is_loopback=*/false) == PageTransport::kGivenTls) (void)GivenTls(web);
}

PageSocket OpenPageSocket(WebConfig& web, const std::string& otherwise) {
  PageSocket socket;
  const auto open = [&] {
    const ListenAddress listen = ParseListenAddress(web.listen).value_or(ListenAddress{});
    socket.fd = web::OpenListenSocket(listen.address, listen.port);
    if (!web::HasAddress(listen.address)) {
      socket.warning = say::upkeep::NoSuchAddress(listen.address);
    }
  };
  try {
    open();
  } catch (const IoError& error) {
    if (web.listen == otherwise) throw;
    socket.fault = say::upkeep::ListenUnusable(error.message(), otherwise);
    web.listen = otherwise;
    open();
  }
  return socket;
}

PageNotes IdentifyPage(const Config& config, web::HttpServerOptions& options) {
  PageNotes notes;
  const std::string address =
      options.listen_fd ? web::AddressTextOf(*options.listen_fd) : options.address;
  const PageTransport transport = TransportOf(config.web, web::IsLoopback(address));
  if (transport == PageTransport::kGivenTls) options.tls = GivenTls(config.web);
  if (transport == PageTransport::kOwnTls) {
    options.tls = OwnTls(config, notes.warnings);
    options.keep_certificate = [state = config.appliance.state](const auto& identity) {
      KeepPageIdentity(state, identity);
    };
    options.make_certificate = [state = config.appliance.state, names = config.web.host_names](
                                   const auto now) { return Issued(state, names, now); };
  }
  if (transport == PageTransport::kPlainOnNetwork)
    notes.warnings.push_back(say::upkeep::PageWithoutTls());
  options.device_key = DeviceKey(config, notes.warnings);
  if (options.tls) notes.certificate = options.tls->fingerprint;
  const bool is_v6 = address.find(':') != std::string::npos;
  notes.url =
      fmt::format("{}://{}", options.tls ? "https" : "http", is_v6 ? "[" + address + "]" : address);
  return notes;
}

}  // namespace plumb
