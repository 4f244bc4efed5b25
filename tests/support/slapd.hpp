// SPDX-License-Identifier: Apache-2.0
// OpenLDAP's own server (Debian's slapd) as a clinic's directory: three people, two groups.
#pragma once

#include <signal.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "tests/support/free_port.hpp"
#include "tests/support/process.hpp"
#include "tests/support/self_signed.hpp"

namespace plumb::testing {

/// The entries uid=NAME,ou=people,dc=clinic,dc=example: anna of the therapists, marie of the
/// therapists and the physicists, and a visitor of no group.
class Slapd {
 public:
  static constexpr const char* kProgram = "/usr/sbin/slapd";
  static constexpr const char* kPassword = "a long password";  ///< Of all three.
  static constexpr const char* kPerson = "uid={name},ou=people,dc=clinic,dc=example";
  static constexpr const char* kGroups = "ou=groups,dc=clinic,dc=example";

  [[nodiscard]] static bool IsInstalled() { return std::filesystem::exists(kProgram); }

  /// Of a server's socket on this machine.
  [[nodiscard]] static std::string UrlOf(const std::filesystem::path& socket) {
    std::string url = "ldapi://";
    for (const char c : socket.string()) url += c == '/' ? "%2F" : std::string(1, c);
    return url;
  }

  /// @param folder  Of its own; outlives it.
  explicit Slapd(const std::filesystem::path& folder) : folder_(folder) {
    std::filesystem::create_directories(folder_ / "data");
    MakeSelfSigned(certificate(), folder_ / "key.pem", "directory",
                   {.options = "-addext subjectAltName=IP:127.0.0.1"});
    std::ofstream(folder_ / "slapd.conf") << fmt::format(
        "include /etc/ldap/schema/core.schema\ninclude /etc/ldap/schema/cosine.schema\n"
        "include /etc/ldap/schema/inetorgperson.schema\n"
        "modulepath /usr/lib/ldap\nmoduleload back_mdb\n"
        "TLSCertificateFile {0}/cert.pem\nTLSCertificateKeyFile {0}/key.pem\n"
        "database mdb\nmaxsize 8388608\nsuffix \"dc=clinic,dc=example\"\ndirectory {0}/data\n",
        folder_.string());
    std::ofstream(folder_ / "people.ldif") << People();
    Shell("/usr/sbin/slapadd -f slapd.conf -l people.ldif");
    Start();
  }

  /// Waits until it takes connections: the first round of its loop is the first word after it
  /// listens. What it says later is read by a process beside it, or it would wait for a reader.
  void Start() {
    process_ = std::make_unique<Process>(std::vector<std::string>{
        "/bin/bash", "-c", "exec \"$@\" 2> >(sed -u '/epoll: listen=/q' >&2; exec cat >/dev/null)",
        "slapd", kProgram, "-d", "conns", "-f", (folder_ / "slapd.conf").string(), "-h",
        tls_url() + " " + plain_url() + " " + local_url()});
    if (!process_->WaitForStderr("epoll: listen="))
      throw std::runtime_error("slapd: " + process_->err());
  }
  /// Kills it, so that its clients get no farewell.
  void Stop() { process_.reset(); }
  /// Takes connections, and never speaks again.
  void Freeze() const { process_->Signal(SIGSTOP); }

  [[nodiscard]] int tls_port() const { return tls_port_; }
  [[nodiscard]] std::string tls_url() const {
    return fmt::format("ldaps://127.0.0.1:{}", tls_port_);
  }
  /// Without TLS until it is asked for.
  [[nodiscard]] std::string plain_url() const {
    return fmt::format("ldap://127.0.0.1:{}", plain_port_);
  }
  /// Its socket in the folder, without TLS.
  [[nodiscard]] std::string local_url() const { return UrlOf(folder_ / "socket"); }
  [[nodiscard]] std::filesystem::path certificate() const { return folder_ / "cert.pem"; }

 private:
  static std::string People() {
    std::string text =
        "dn: dc=clinic,dc=example\nobjectClass: dcObject\nobjectClass: organization\no: clinic\n"
        "dc: clinic\n\n";
    for (const char* unit : {"people", "groups"})
      text += fmt::format(
          "dn: ou={0},dc=clinic,dc=example\nobjectClass: organizationalUnit\nou: {0}\n\n", unit);
    for (const auto& [uid, title] :
         {std::pair("anna", "one"), std::pair("marie", "two"), std::pair("visitor", "two")})
      text += fmt::format(
          "dn: uid={0},ou=people,dc=clinic,dc=example\nobjectClass: inetOrgPerson\nuid: {0}\n"
          "cn: {0}\nsn: {0}\ntitle: {1}\nuserPassword: {2}\n\n",
          uid, title, kPassword);
    const auto group = [](const char* name) {
      return fmt::format("dn: cn={0},{1}\nobjectClass: groupOfNames\ncn: {0}\n", name, kGroups);
    };
    const auto member = [](const char* uid) {
      return fmt::format("member: uid={},ou=people,dc=clinic,dc=example\n", uid);
    };
    return text + group("physicists") + member("marie") + "\n" + group("therapists") +
           member("marie") + member("anna");
  }
  void Shell(const std::string& command) const {
    const std::string line = fmt::format("cd '{}' && {} >log 2>&1", folder_.string(), command);
    if (std::system(line.c_str()) != 0) throw std::runtime_error("failed: " + line);
  }

  std::filesystem::path folder_;
  const int tls_port_ = FreePort(), plain_port_ = FreePort();
  std::unique_ptr<Process> process_;
};

}  // namespace plumb::testing
