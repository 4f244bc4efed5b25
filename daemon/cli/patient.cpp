// `plumb export-patient` and `plumb import-patient`: one patient out of a store, into another one.
#include <memory>
#include <optional>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "daemon/cli/commands.hpp"
#include "daemon/records/file_cipher.hpp"
#include "daemon/records/patient_transfer.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

struct PatientArguments {
  std::string code;
  fs::path folder, state;
  std::optional<fs::path> key_file;
};

std::unique_ptr<BackupSecret> SecretOf(const PatientArguments& options) {
  return options.key_file ? std::make_unique<BackupSecret>(*options.key_file) : nullptr;
}

void PrintReport(const char* done, const PatientReport& report) {
  std::string text = fmt::format("{} {}: {} scans, {} references, {} files, {:.1f} MB\n", done,
                                 report.code, report.scans, report.references, report.files,
                                 static_cast<double>(report.bytes) / 1e6);
  for (const std::string& problem : report.problems) text += "  " + problem + "\n";
  PrintOut(text);
}

int Export(const PatientArguments& options, const CommandContext& context) {
  const PatientReport report =
      ExportPatient(fs::absolute(options.state), options.code, fs::absolute(options.folder),
                    context.stop, SecretOf(options).get());
  PrintReport("exported", report);
  return report.problems.empty() ? kDone : kBadInput;
}

int Import(const PatientArguments& options, const CommandContext& context) {
  const PatientReport report =
      ImportPatient(fs::absolute(options.folder), fs::absolute(options.state), context.stop,
                    SecretOf(options).get());
  PrintReport(report.was_there ? "is there already with the same data:" : "imported", report);
  return kDone;
}

}  // namespace

Command AddExportPatient(CLI::App& app) {
  auto options = std::make_shared<PatientArguments>();
  app.add_option("code", options->code, "The patient's code")->required()->type_name("CODE");
  app.add_option(
         "folder", options->folder,
         "Folder of the export, or one file if its name ends in .tar; an older export there is "
         "replaced")
      ->required()
      ->type_name("FOLDER|FILE.tar");
  app.add_option(
         "--state", options->state,
         "State folder that no plumbd is using, or the folder of a backup that is not encrypted")
      ->required()
      ->type_name("DIR");
  app.add_option("--key-file", options->key_file, "Encrypt with the key in this file")
      ->type_name("FILE");
  return [options](const CommandContext& context) { return Export(*options, context); };
}

Command AddImportPatient(CLI::App& app) {
  auto options = std::make_shared<PatientArguments>();
  app.add_option("folder", options->folder, "The export")->required()->type_name("FOLDER|FILE.tar");
  app.add_option("--state", options->state, "State folder that no plumbd is using")
      ->required()
      ->type_name("DIR");
  app.add_option("--key-file", options->key_file, "File with the key of an encrypted export")
      ->type_name("FILE");
  return [options](const CommandContext& context) { return Import(*options, context); };
}

}  // namespace plumb
