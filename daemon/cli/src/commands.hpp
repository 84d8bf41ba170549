#pragma once
/// One function per subcommand. Each adds its subcommand to `parent`. CLI11 calls the callback of
/// the subcommand, which executes the command and stores the exit code in `exit`. The callback owns
/// the variables of the options.

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

namespace abbe::daemon {

void add_identify_otf(CLI::App& parent, int& exit);
void add_identify_evemu(CLI::App& parent, int& exit);
void add_identify_mfb(CLI::App& parent, int& exit);
void add_identify_bar(CLI::App& parent, int& exit);
void add_identify_joint(CLI::App& parent, int& exit);
void add_identify_artefact(CLI::App& parent, int& exit);
void add_plan_otf(CLI::App& parent, int& exit);
void add_plan_mfb(CLI::App& parent, int& exit);
void add_calibrate_otf(CLI::App& parent, int& exit);
void add_calibrate_evemu(CLI::App& parent, int& exit);
void add_calibrate_mfb(CLI::App& parent, int& exit);
void add_reference(CLI::App& parent, int& exit);
void add_sensors(CLI::App& parent, int& exit);
void add_machine(CLI::App& parent, int& exit);
void add_machine_identity(CLI::App& machine, int& exit);
void add_tracker(CLI::App& parent, int& exit);
void add_probe_lines(CLI::App& parent, int& exit);
void add_calibrate_probe(CLI::App& parent, int& exit);
void add_calibrate_artefact(CLI::App& parent, int& exit);
void add_calibrate_bar(CLI::App& parent, int& exit);
void add_replay(CLI::App& parent, int& exit);
void add_verify(CLI::App& parent, int& exit);
void add_report(CLI::App& parent, int& exit);
void add_example(CLI::App& parent, int& exit);
void add_status(CLI::App& parent, int& exit);
void add_model_compare(CLI::App& parent, int& exit);
void add_model_drift(CLI::App& parent, int& exit);
void add_model_eval(CLI::App& parent, int& exit);
void add_model_list(CLI::App& parent, int& exit);
void add_model_show(CLI::App& parent, int& exit);
void add_model_add(CLI::App& parent, int& exit);
void add_model_activate(CLI::App& parent, int& exit);
void add_model_rollback(CLI::App& parent, int& exit);
void add_model_prune(CLI::App& parent, int& exit);
void add_export(CLI::App& parent, int& exit);

}  // namespace abbe::daemon
