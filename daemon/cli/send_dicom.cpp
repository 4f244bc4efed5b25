// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/language.hpp"
#include "daemon/cli/progress.hpp"
#include "drivers/dicom/dicom_send.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

struct SendDicomArguments {
  std::vector<std::filesystem::path> files;
  std::string to;
  DicomSendRequest request;
};

int RunSendDicom(const SendDicomArguments& options, const CommandContext& context) {
  DicomSendRequest request = options.request;
  const std::optional<DicomPeer> peer = ParseDicomPeer(options.to);
  if (!peer) throw InvalidRequest(say::dicom::NoPeer(options.to));
  if (!IsAeTitle(request.own_ae_title))
    throw InvalidRequest(say::dicom::NoAeTitle(request.own_ae_title));
  if (!request.tls.empty() && !request.tls.complete())
    throw InvalidRequest(say::dicom::ThreeTlsFiles());
  request.peer = *peer;
  for (const std::filesystem::path& file : options.files)
    request.files.push_back(std::filesystem::absolute(file).string());
  Progress progress(context.language);
  const auto total = static_cast<std::int64_t>(request.files.size());
  const auto say = [&](std::size_t sent) {
    progress.Update(say::dicom::Sending(static_cast<std::int64_t>(sent), total, options.to),
                    static_cast<double>(sent) / static_cast<double>(total));
  };
  say(0);
  SendDicom(request, say);
  progress.Clear();
  PrintOut(context.Said(say::dicom::Sent(options.to, total)) + "\n");
  return kDone;
}

}  // namespace

Command AddSendDicom(CLI::App& app) {
  auto options = std::make_shared<SendDicomArguments>();
  app.add_option("files", options->files, "DICOM files, such as those of plumb export-dicom")
      ->required()
      ->type_name("FILE...");
  app.add_option("--to", options->to, "The node that stores them")
      ->required()
      ->type_name("AETITLE@HOST:PORT");
  app.add_option("--from", options->request.own_ae_title, "Own AE title")
      ->capture_default_str()
      ->type_name("AETITLE");
  DicomTlsFiles& tls = options->request.tls;
  app.add_option("--tls-certificate", tls.certificate, "TLS (BCP 195): own certificate, PEM")
      ->type_name("FILE");
  app.add_option("--tls-key", tls.key, "Its key, PEM, not encrypted")->type_name("FILE");
  app.add_option("--tls-trusted", tls.trusted, "Certificate that signed the node's, PEM")
      ->type_name("FILE");
  return [options](const CommandContext& context) { return RunSendDicom(*options, context); };
}

}  // namespace plumb
