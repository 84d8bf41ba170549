#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <cstdio>
#include <memory>

#include "abbe/tasks/export_model.hpp"
#include "commands.hpp"
#include "force_option.hpp"
#include "store_option.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

struct ExportCommand : ExportArguments {
  bool json = false;
};

int run_export(const ExportCommand& arguments) {
  const auto done = export_model(arguments, print_cautions);
  if (!done) return report(done.error());
  const auto text = arguments.json ? report_json(*done) : report_text(*done);
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0)
    return report({ErrorCode::Io, "write the report to stdout: it is closed or full"});
  return 0;
}

}  // namespace

void add_export(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<ExportCommand>();
  auto* command = parent.add_subcommand(
      "export",
      "Write a model as compensation file of a control.\n"
      "The file is read back as the control reads it, and compared at 1000 places of the volume\n"
      "with what the format can hold; only then it gets its name. The report states the sign, and\n"
      "in um what the format loses. A model that must not be used (refused by the gate,\n"
      "drifted; with -c also one of another machine configuration) is refused, unless --force.");
  command->add_option("MODEL", arguments->model, kModelText)->required();
  add_store_options(*command, arguments->store);
  command->add_option("--to", arguments->to, "format: " + format_names())->required();
  command
      ->add_option("-o,--out", arguments->out,
                   "file; for linuxcnc-comp and heidenhain-com a folder, with the report in "
                   "export.txt")
      ->required();
  command->add_option("--tool-mm", arguments->tool,
                      "x,y,z: tool offset in mm; default: that of the calibration");
  command->add_option("--step-mm", arguments->step_mm,
                      "largest distance of nodes in mm; default: the nodes of linear tables, 32 "
                      "equal steps of other models");
  command->add_option("--volume-mm", arguments->volume,
                      "xmin,xmax,ymin,ymax,zmin,zmax in mm: a part of the volume; default: the box "
                      "around the validity volume");
  command->add_option("--axis-map", arguments->axis_map,
                      "names of X, Y and Z on the control, such as X=AX1,Y=AX2,Z=AX3");
  command->add_option("--positive", arguments->positive,
                      "plus or minus: the direction in which a positive value moves the axis of "
                      "this control; siemens-cec and heidenhain-com need it");
  command->add_option("--direction", arguments->direction,
                      "of csv-grid: direction in which X, Y and Z last moved, such as +,-,0, for a "
                      "model with backlash; default: the mean of both directions");
  add_force_options(*command, arguments->force,
                    "export a model that must not be used; file and report state it",
                    "reason, for the file; required with --force");
  command->add_flag("--json", arguments->json, "print the report as JSON");
  command->callback([arguments, &exit] { exit = run_export(*arguments); });
}

}  // namespace abbe::daemon
