// SPDX-License-Identifier: Apache-2.0
// Planning CTs and results over a network: the real programs, and Orthanc where it is installed.
#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <memory>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "drivers/files/descriptor.hpp"
#include "tests/integration/command_line.hpp"
#include "tests/support/http_client.hpp"
#include "tests/support/skip.hpp"
#include "tests/unit/dicom/small_files.hpp"

namespace plumb {
namespace {

using ::testing::HasSubstr;

class DicomNetworkTest : public CommandLineTest {
 protected:
  void SetUp() override {
    CommandLineTest::SetUp();
    const auto [structures, plan] = SmallCt();
    structures_ = Written(folder_ / "structures.dcm", DicomBytes(structures));
    plan_ = Written(folder_ / "plan.dcm", DicomBytes(plan));
    fs::create_directory(folder_ / "spool");
  }

  /// Starts plumb-dicomd on a free port, by which it is asked from then on.
  void Start(const std::string& more = "", int port = 0) {
    WriteText(folder_ / "plumb.toml",
              fmt::format("[dicom]\nenabled = true\nlisten = \"127.0.0.1:{}\"\n"
                          "senders = [\"PLUMB@127.0.0.1\", \"ORTHANC@127.0.0.1\"]\n"
                          "spool = \"{}\"\n{}\n",
                          port, (folder_ / "spool").string(), more));
    dicomd_ = std::make_unique<Process>(
        std::vector<std::string>{PLUMB_DICOMD_BINARY, "--config", folder_ / "plumb.toml"});
    ASSERT_TRUE(dicomd_->WaitForStderr(", ")) << dicomd_->err();
    const std::string& said = dicomd_->err();
    port_ = std::stoi(said.substr(said.find(" port ") + 6));
  }
  [[nodiscard]] std::string Node(const std::string& title = "PLUMB") const {
    return fmt::format("{}@127.0.0.1:{}", title, port_);
  }
  [[nodiscard]] std::vector<fs::path> Received() const {
    std::vector<fs::path> files;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder_ / "spool"))
      if (entry.path().extension() == ".dcm") files.push_back(entry.path());
    return files;
  }
  /// The received file of that class, by the note beside it.
  [[nodiscard]] fs::path ReceivedOf(const std::string& class_uid) const {
    for (const fs::path& file : Received()) {
      const auto note = nlohmann::json::parse(ReadText(fs::path(file).replace_extension(".json")));
      if (note.at("class_uid") == class_uid && note.at("bytes") == fs::file_size(file)) return file;
    }
    return {};
  }
  /// A connection that says nothing.
  [[nodiscard]] Descriptor Connected() const {
    Descriptor connection(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(port_));
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(connection.get(), reinterpret_cast<const sockaddr*>(&to), sizeof to), 0);
    return connection;
  }
  /// Makes NAME.pem and NAME.key, which sign themselves.
  void MakeCertificate(const std::string& name) {
    const RunResult made = plumb::Run(
        {"/usr/bin/openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj",
         "/CN=" + name, "-keyout", folder_ / (name + ".key"), "-out", folder_ / (name + ".pem")});
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }

  fs::path structures_, plan_;
  std::unique_ptr<Process> dicomd_;
  int port_ = 0;
};

TEST_F(DicomNetworkTest, WhatIsReceivedIsWhatWasSentAndCanBeImported) {
  Start();
  const RunResult sent = Plumb({"send-dicom", structures_, plan_, "--to", Node()});
  ASSERT_EQ(sent.exit_code, 0) << sent.err;
  EXPECT_THAT(sent.out, HasSubstr("stored 2 files"));
  ASSERT_EQ(Received().size(), 2U);
  const RunResult imported =
      Plumb({"import-dicom", ReceivedOf("1.2.840.10008.5.1.4.1.1.481.3"),
             ReceivedOf("1.2.840.10008.5.1.4.1.1.481.5"), "--out", folder_ / "planned"});
  EXPECT_EQ(imported.exit_code, 0) << imported.err;
  // Sent again it is another file: nothing that was received is ever replaced.
  ASSERT_EQ(Plumb({"send-dicom", plan_, "--to", Node()}).exit_code, 0);
  EXPECT_EQ(Received().size(), 3U);
  for (const fs::path& file : Received())
    EXPECT_EQ(file.filename().string().find("2.25"), std::string::npos) << file;
  dicomd_->Signal(SIGTERM);
  EXPECT_EQ(dicomd_->Wait(), 0);
  EXPECT_EQ(dicomd_->err().find("SIM-1"), std::string::npos);
  EXPECT_THAT(dicomd_->err(), HasSubstr("kept RTPlanStorage of 'PLUMB'"));
}

TEST_F(DicomNetworkTest, TitlesAndClassesThatAreNotExpectedAreRefusedWithTheCause) {
  Start();
  const RunResult called = Plumb({"send-dicom", plan_, "--to", Node("OTHER")});
  EXPECT_EQ(called.exit_code, 3);
  EXPECT_THAT(called.err, HasSubstr("called AE title not recognized"));
  const RunResult calling = Plumb({"send-dicom", plan_, "--to", Node(), "--from", "NOBODY"});
  EXPECT_EQ(calling.exit_code, 3);
  EXPECT_THAT(calling.err, HasSubstr("calling AE title not recognized"));
  TreatmentPlan ion = SmallCt().second;
  ion.file.class_uid = "1.2.840.10008.5.1.4.1.1.481.8";
  const fs::path other = Written(folder_ / "ion.dcm", DicomBytes(ion));
  EXPECT_EQ(Plumb({"send-dicom", other, "--to", Node()}).exit_code, 3);
  // Together with a class that is received the cause is known.
  const RunResult both = Plumb({"send-dicom", plan_, other, "--to", Node()});
  EXPECT_EQ(both.exit_code, 3);
  EXPECT_THAT(both.err, HasSubstr("does not accept"));
  EXPECT_TRUE(Received().empty());
  WriteText(folder_ / "letter.dcm", "a letter");
  EXPECT_EQ(Plumb({"send-dicom", folder_ / "letter.dcm", "--to", Node()}).exit_code, 3);
}

TEST_F(DicomNetworkTest, SilentAndSenselessConnectionsHoldNobodyUp) {
  Start();
  std::vector<Descriptor> silent;
  for (int i = 0; i < 3; ++i) silent.push_back(Connected());
  const std::string senseless(3000, '\xFF');
  const Descriptor wrong = Connected();
  (void)::send(wrong.get(), senseless.data(), senseless.size(), MSG_NOSIGNAL);
  ASSERT_TRUE(dicomd_->WaitForStderr("refused: no association"));
  const RunResult sent = Plumb({"send-dicom", plan_, "--to", Node()});
  EXPECT_EQ(sent.exit_code, 0) << sent.err;
  EXPECT_EQ(Received().size(), 1U);
}

TEST_F(DicomNetworkTest, OneAddressHasFourConnectionsAtMost) {
  Start();
  std::vector<Descriptor> silent;
  for (int i = 0; i < 4; ++i) silent.push_back(Connected());
  EXPECT_EQ(Plumb({"send-dicom", plan_, "--to", Node()}).exit_code, 3);
  EXPECT_TRUE(dicomd_->WaitForStderr("too many connections")) << dicomd_->err();
  EXPECT_TRUE(Received().empty());
}

TEST_F(DicomNetworkTest, AFullSpoolStoresNothingMore) {
  Start("quota_mb = 1");
  fs::resize_file(Written(folder_ / "spool" / "earlier.dcm", "x"), 1'000'000);
  const RunResult full = Plumb({"send-dicom", plan_, "--to", Node()});
  EXPECT_EQ(full.exit_code, 3);
  EXPECT_THAT(full.err, HasSubstr("A700"));
  EXPECT_EQ(Received().size(), 1U);
}

TEST_F(DicomNetworkTest, WithTlsOnlyATrustedCertificateMaySend) {
  MakeCertificate("clinic");
  MakeCertificate("other");
  const auto file = [&](const char* name) { return (folder_ / name).string(); };
  Start(fmt::format("tls_certificate = \"{}\"\ntls_key = \"{}\"\ntls_trusted = \"{}\"",
                    file("clinic.pem"), file("clinic.key"), file("clinic.pem")));
  const auto send = [&](const std::string& name) {
    return Plumb({"send-dicom", plan_, "--to", Node(), "--tls-certificate",
                  file("") + name + ".pem", "--tls-key", file("") + name + ".key", "--tls-trusted",
                  file("clinic.pem")});
  };
  EXPECT_EQ(send("clinic").exit_code, 0);
  EXPECT_EQ(send("other").exit_code, 3);
  EXPECT_EQ(Plumb({"send-dicom", plan_, "--to", Node()}).exit_code, 3);
  EXPECT_EQ(Received().size(), 1U);
  dicomd_->Signal(SIGTERM);
  EXPECT_EQ(dicomd_->Wait(), 0);
  EXPECT_THAT(dicomd_->err(), HasSubstr("certificate verify failed"));
}

TEST_F(DicomNetworkTest, WithoutBeingEnabledNothingIsReceived) {
  WriteText(folder_ / "plumb.toml", "");
  const RunResult off = plumb::Run({PLUMB_DICOMD_BINARY, "--config", folder_ / "plumb.toml"});
  EXPECT_EQ(off.exit_code, 0);
  EXPECT_THAT(off.err, HasSubstr("receiving is off"));
  WriteText(folder_ / "plumb.toml", "[dicom]\nenabled = true\nlisten = \"0.0.0.0:11112\"\n");
  EXPECT_EQ(plumb::Run({PLUMB_DICOMD_BINARY, "--config", folder_ / "plumb.toml"}).exit_code, 3);
}

/// Orthanc with a DICOM port and a port for its web interface.
class OrthancTest : public DicomNetworkTest {
 protected:
  static constexpr int kHttpPort = 38'042, kDicomPort = 38'242;

  /// False where Orthanc is not installed.
  bool StartOrthanc() {
    const char* given = std::getenv("PLUMB_ORTHANC");
    const std::string program = given != nullptr ? given : "/usr/sbin/Orthanc";
    if (!fs::exists(program)) return false;
    const nlohmann::json config = {{"StorageDirectory", (folder_ / "orthanc").string()},
                                   {"IndexDirectory", (folder_ / "orthanc").string()},
                                   {"HttpPort", kHttpPort},
                                   {"DicomPort", kDicomPort},
                                   {"DicomAet", "ORTHANC"},
                                   {"DicomCheckCalledAet", true},
                                   {"AuthenticationEnabled", false},
                                   {"DicomAlwaysAllowStore", false},
                                   {"DicomModalities", {{"plumb", {"PLUMB", "127.0.0.1", port_}}}}};
    WriteText(folder_ / "orthanc.json", config.dump());
    orthanc_ =
        std::make_unique<Process>(std::vector<std::string>{program, folder_ / "orthanc.json"});
    return orthanc_->WaitForStderr("Orthanc has started");
  }
  test::HttpClient web_{kHttpPort};
  std::unique_ptr<Process> orthanc_;
};

// The whole way: a plan comes from an archive, is compared with, and the result goes back.
TEST_F(OrthancTest, APlanComesFromOrthancAndTheReportGoesBack) {
  Start();
  if (!StartOrthanc())
    PLUMB_SKIP("Orthanc is not installed: apt install orthanc, or name it in PLUMB_ORTHANC");
  structures_ = SmallCtSuite() / "recordings" / "ct_HFS" / "structures.dcm";
  plan_ = structures_.parent_path() / "plan.dcm";
  std::vector<std::string> pushed;
  for (const fs::path& file : {structures_, plan_}) {
    const auto stored = web_.Ask("POST", "/instances", ReadText(file)).json();
    ASSERT_TRUE(stored.contains("ID")) << stored;
    pushed.push_back(stored.at("ID"));
  }
  EXPECT_EQ(web_.Post("/modalities/plumb/echo", nlohmann::json::object()).status, 200);
  const auto push = web_.Post("/modalities/plumb/store", {{"Resources", pushed}}).json();
  ASSERT_EQ(push.value("InstancesCount", 0), 2) << push;
  ASSERT_EQ(Received().size(), 2U) << dicomd_->err();

  const fs::path current = folder_ / "current";
  ASSERT_EQ(Plumb({"reconstruct", SmallCtSuite() / "recordings" / "placement_1", "--out", current})
                .exit_code,
            0);
  const RunResult imported =
      Plumb({"import-dicom", ReceivedOf("1.2.840.10008.5.1.4.1.1.481.3"),
             ReceivedOf("1.2.840.10008.5.1.4.1.1.481.5"), "--out", folder_ / "planned"});
  ASSERT_EQ(imported.exit_code, 0) << imported.err;
  const RunResult compared =
      Plumb({"compare", folder_ / "planned", current, "--config", SmallCtSuite() / "room.toml",
             "--out", folder_ / "result", "--json"});
  ASSERT_EQ(compared.exit_code, 0) << compared.err;
  const auto correction = nlohmann::json::parse(compared.out).at("correction");
  for (const char* number : {"vertical_mm", "longitudinal_mm", "lateral_mm"})
    EXPECT_LT(std::abs(correction.at(number).get<double>()), 8) << number;
  for (const char* number : {"pitch_deg", "roll_deg", "yaw_deg"})
    EXPECT_LT(std::abs(correction.at(number).get<double>()), 2) << number;
  const RunResult exported =
      Plumb({"export-dicom", folder_ / "result", "--reference", folder_ / "planned", "--current",
             current, "--out", folder_ / "exported", "--patient-id", "SIM-1"});
  ASSERT_EQ(exported.exit_code, 0) << exported.err;
  std::vector<std::string> line = {"send-dicom", "--to",
                                   fmt::format("ORTHANC@127.0.0.1:{}", kDicomPort)};
  std::size_t num_sent = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_ / "exported")) {
    line.push_back(entry.path());
    ++num_sent;
  }
  const RunResult sent = Plumb(line);
  ASSERT_EQ(sent.exit_code, 0) << sent.err;
  EXPECT_EQ(web_.Get("/instances").json().size(), 2 + num_sent);
  const auto patients = web_.Get("/patients?expand").json();
  ASSERT_EQ(patients.size(), 1U) << patients;  // the report lies with the plan's patient
  const auto series = web_.Get("/series?expand").json();
  EXPECT_TRUE(std::ranges::any_of(series, [](const nlohmann::json& one) {
    return one.at("MainDicomTags").at("Modality") == "DOC";
  })) << series;
  // What Orthanc does not know is refused with its cause.
  const RunResult unknown =
      Plumb({"send-dicom", plan_, "--to", fmt::format("WRONG@127.0.0.1:{}", kDicomPort)});
  EXPECT_EQ(unknown.exit_code, 3);
  EXPECT_THAT(unknown.err, HasSubstr("called AE title not recognized"));
}

}  // namespace
}  // namespace plumb
