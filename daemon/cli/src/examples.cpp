#include "examples.hpp"

#include <fmt/format.h>

#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <array>
#include <string>
#include <string_view>

namespace abbe::daemon {
namespace {

struct Example {
  std::string_view command;  ///< the command without "abbe "
  std::string_view arguments;
};

constexpr std::array kExamples{
    Example{"status", "-c /etc/abbe/abbed.toml"},
    Example{"calibrate", "otf --path path.csv"},
    Example{"calibrate otf", "--path path.csv"},
    Example{"calibrate evemu", "--calibrator calibrator.toml"},
    Example{"calibrate probe", "--recording run.mcap"},
    Example{"calibrate artefact", "--calibrator nominal.toml --at-mm 100,50,20 -o calibrator.toml"},
    Example{"calibrate bar", "--bar nominal.toml --plan plan.toml --gauge gauge.toml -o bar.toml"},
    Example{"plan", "otf --machine machine.toml --tracker-at-mm=-750,-620,-350 -o plan"},
    Example{"plan otf",
            "-c abbed.toml --tracker-at-mm=-750,-620,-350 --tracker-at-mm=900,-600,-300\n"
            "           --budget-min 15 --feed-mm-per-min 2500 --dialect linuxcnc -o plan"},
    Example{"plan mfb",
            "-c machine.toml --bar bar.toml --stylus-mm=0,0,-150 --stylus-mm=100,0,-150 \\\n"
            "           --stylus-mm=-100,0,-150 --stylus-mm=0,100,-150 --stylus-mm=0,-100,-150 \\\n"
            "           -o plan.toml\n"
            "         abbe plan mfb -c machine.toml --bar bar.toml --check plan.toml"},
    Example{"reference", "--here --axis X"},
    Example{"sensors", "accept scale_x --why \"compared with a thermometer\""},
    Example{"sensors accept", "scale_x --why \"compared with a thermometer\""},
    Example{"machine", "where"},
    Example{"machine where", ""},
    Example{"machine stop", ""},
    Example{"machine identity", ""},
    Example{"machine identity keep", "--reason \"computer replaced\""},
    Example{"machine identity new", "--reason \"second machine, set up from the first\""},
    Example{"machine release", ""},
    Example{"tracker", "status"},
    Example{"tracker status", ""},
    Example{"tracker initialize", ""},
    Example{"tracker home", ""},
    Example{"tracker find", "--distance-m 2.5"},
    Example{"tracker reflector", "list"},
    Example{"tracker reflector list", ""},
    Example{"tracker reflector set", "7"},
    Example{"probe-lines",
            "--host 10.0.0.7 --port 7001\n"
            "         abbe probe-lines --host 10.0.0.7 --port 7001 --columns time,x,y,z,status \\\n"
            "           --valid-status 0 --length-unit mm --weather compute --frame tracker "
            "-o tracker.toml"},
    Example{"replay", "run.mcap --raw"},
    Example{"identify", "otf --recording run.mcap -o result"},
    Example{"identify otf",
            "--machine machine.toml --path path.csv --tracker tracker.csv -o result"},
    Example{"identify evemu",
            "--machine machine.toml --touches touches.csv --calibrator calibrator.toml -o result"},
    Example{"identify mfb",
            "--machine machine.toml --bar bar.toml --plan plan.toml --points points.csv -o result"},
    Example{
        "identify bar",
        "--bar nominal.toml --plan plan.toml --points points.csv --gauge gauge.toml -o bar.toml"},
    Example{"identify joint", "--machine machine.toml --parts parts.toml -o result"},
    Example{"identify artefact",
            "--touches touches.csv --name array-1 --tip-radius-mm 2.5 -o calibrator.toml"},
    Example{"verify", "active --recording run.mcap -o result"},
    Example{"report",
            "active -o report.html\n"
            "         abbe report 6ad1 --details certificate.toml --dcc certificate.xml "
            "--as-left active"},
    Example{"model", "list"},
    Example{"model eval", "active --points points.csv"},
    Example{"model compare", "active model.json"},
    Example{"model drift", "active result/model.json"},
    Example{"model list", "--store /var/lib/abbe/models"},
    Example{"model show", "result/model.json"},
    Example{"model add", "out/model.json -c /etc/abbe/abbed.toml"},
    Example{"model activate", "6ad1 --why \"verified with the step gauge\""},
    Example{"model rollback", "--why \"parts out of tolerance\""},
    Example{"model prune", "--keep-newest 1000 --keep-days 365"},
    Example{"export", "active --to linuxcnc-comp -o compensation"},
    Example{"dds", "keys -o dds-keys"},
    Example{"dds keys", "-o dds-keys --subscribers 2"},
    Example{"example", "calibrator.toml > calibrator.toml"},
};

const Example* example_of(std::string_view command) {
  for (const auto& example : kExamples) {
    if (example.command == command) return &example;
  }
  return nullptr;
}

void add_example_to(CLI::App& app, const std::string& command) {
  if (const auto* example = example_of(command); example != nullptr)
    app.footer(fmt::format("Example: abbe {}{}{}\n{}", command,
                           example->arguments.empty() ? "" : " ", example->arguments,
                           app.get_footer()));

  for (auto* sub : app.get_subcommands([](const CLI::App*) { return true; }))
    add_example_to(*sub, command.empty() ? sub->get_name() : command + " " + sub->get_name());
}

}  // namespace

void add_examples(CLI::App& app) {
  add_example_to(app, "");
}

}  // namespace abbe::daemon
