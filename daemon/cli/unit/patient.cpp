// SPDX-License-Identifier: Apache-2.0
// `plumb export-patient` and `plumb import-patient`: one patient out of a store, into another one.
#include <cstdint>
#include <memory>
#include <string_view>

#include <CLI/CLI.hpp>

#include "daemon/archive/patient_transfer.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/unit/backup_keys.hpp"
#include "words/cli.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

struct PatientArguments {
  std::string code;
  fs::path folder, state;
  RecipientOptions recipients;
  IdentityOptions keys;
};

void PrintReport(Message (*done)(std::string_view, std::int64_t, std::int64_t, std::int64_t,
                                 double),
                 const PatientReport& report, const CommandContext& context) {
  std::string text = context.Said(done(report.code, static_cast<std::int64_t>(report.scans),
                                       static_cast<std::int64_t>(report.references),
                                       static_cast<std::int64_t>(report.files),
                                       static_cast<double>(report.bytes) / 1e6)) +
                     "\n";
  for (const Message& problem : report.problems) text += "  " + context.Said(problem) + "\n";
  PrintOut(text);
}

int Export(const PatientArguments& options, const CommandContext& context) {
  const PatientReport report =
      ExportPatient(fs::absolute(options.state), options.code, fs::absolute(options.folder),
                    context.stop, options.recipients.Read());
  PrintReport(say::cli::Exported, report, context);
  return report.problems.empty() ? kDone : kBadInput;
}

int Import(PatientArguments& options, const CommandContext& context) {
  const PatientReport report = ImportPatient(
      fs::absolute(options.folder), fs::absolute(options.state), context.stop, options.keys.Read());
  PrintReport(report.was_there ? say::cli::AlreadyThere : say::cli::Imported, report, context);
  return kDone;
}

}  // namespace

Command AddExportPatient(CLI::App& app) {
  auto options = std::make_shared<PatientArguments>();
  app.add_option("code", options->code, "The patient's code")->required()->type_name("CODE");
  app.add_option(
         "folder", options->folder,
         "Folder of the export, or one file if its name ends in .tar; an older export there is "
         "replaced. An encrypted one is a file, and .tar.age is added to its name")
      ->required()
      ->type_name("FOLDER|FILE.tar");
  app.add_option(
         "--state", options->state,
         "State folder that no plumbd is using, or the folder of a backup that is not encrypted")
      ->required()
      ->type_name("DIR");
  options->recipients.AddTo(app);
  return [options](const CommandContext& context) { return Export(*options, context); };
}

Command AddImportPatient(CLI::App& app) {
  auto options = std::make_shared<PatientArguments>();
  app.add_option("folder", options->folder, "The export")->required()->type_name("FOLDER|FILE.tar");
  app.add_option("--state", options->state, "State folder that no plumbd is using")
      ->required()
      ->type_name("DIR");
  options->keys.AddTo(app);
  return [options](const CommandContext& context) { return Import(*options, context); };
}

}  // namespace plumb
