/// `abbe report MODEL`: makes the report of a stored model again; compares two models; shows the
/// trend of a machine; writes a Digital Calibration Certificate.

#include <fmt/format.h>

#include <memory>

#include "abbe/base/printable.hpp"
#include "abbe/tasks/write_report.hpp"
#include "commands.hpp"
#include "force_option.hpp"
#include "store_option.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

int run_report(const ReportArguments& arguments) {
  ProgressBar bar;
  bar.show("making the report", 0.0);
  const auto made = make_report(arguments, [](const StoreEntry& entry) {
    fmt::print(stderr, "abbe: model {} is left out: {}\n", entry.id, printable_line(entry.fault));
  });
  bar.clear();
  if (!made) return report(made.error());
  if (made->verdict.signal != Signal::Green) fmt::print("verdict     {}\n", made->verdict.text);
  const auto show_written = [&bar](const std::string& file) {
    bar.clear();
    fmt::print("written     {}\n", file);
  };
  const auto done = write_report(*made, show_written, bar.progress());
  bar.clear();
  return done ? 0 : report(done.error());
}

}  // namespace

void add_report(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<ReportArguments>();
  auto* command = parent.add_subcommand(
      "report",
      "Write the report of a model as HTML that prints on A4: verdict, volumetric error, values "
      "of\n"
      "ISO 230-1, 230-2 and 230-6 with uncertainty, what is not known, origin. The same model,\n"
      "state of the store, details and time zone give the same bytes at any time.");
  command
      ->add_option("MODEL", arguments->model,
                   "model id, the beginning of an id (at least 4 characters), \"active\", or the "
                   "path of a model.json")
      ->required();
  auto* compare = command->add_option("--compare", arguments->compare,
                                      "another model, given like MODEL: both side by side");
  command
      ->add_flag("--trend", arguments->trend,
                 "all models in the store of the machine of MODEL, over time")
      ->excludes(compare);
  add_store_options(*command, arguments->store);
  command->add_option("-o,--out", arguments->out,
                      "HTML file; default: report-ID.html, compare-ID.html or trend-ID.html");
  command->add_option("--pdf", arguments->pdf,
                      "also write this PDF file; needs weasyprint or chromium");
  command->add_option("--details", arguments->details,
                      "certificate.toml: people, serial numbers, conditions (abbe example "
                      "certificate.toml)");
  auto* dcc = command->add_option(
      "--dcc", arguments->dcc,
      "also write this XML file: Digital Calibration Certificate (PTB DCC 3.2.1), not signed;\n"
      "needs --details");
  add_force_options(*command, arguments->force,
                    "certify a model that the gate refused; certificate and report state it",
                    "reason, for the certificate; required with --force")
      ->needs(dcc);
  command
      ->add_option("--as-left", arguments->as_left,
                   "model measured after the adjustment, for --dcc; MODEL is then as found")
      ->needs(dcc);
  command->callback([arguments, &exit] { exit = run_report(*arguments); });
}

}  // namespace abbe::daemon
