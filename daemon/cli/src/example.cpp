#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "abbe/base/faults.hpp"
#include "commands.hpp"
#include "example_files.hpp"
#include "run_program.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

struct Purpose {
  std::string_view name, text;
};
constexpr std::array kPurposes{
    Purpose{"abbed.toml", "the daemon: machine, devices, checks; every key with its default"},
    Purpose{"machine.toml", "the machine alone, for abbe identify and abbe sim"},
    Purpose{"first_abbed.toml",
            "a first abbed.toml: three axes, CANopen encoders, a laser tracker"},
    Purpose{"sim.toml", "abbe sim: simulated machine and devices; every key with its default"},
    Purpose{"calibrator.toml", "a calibrated ball array"},
    Purpose{"path.csv", "the path of a calibration on the fly"},
    Purpose{"tracker.csv", "points of a laser tracker along the path"},
    Purpose{"encoder.csv", "scale readings along the path"},
    Purpose{"touches.csv", "touches of a ball array"},
    Purpose{"bar.toml", "a calibrated Multi-Feature Bar"},
    Purpose{"plan.toml", "measurements with a bar: positions, tools, noise, for abbe identify mfb"},
    Purpose{"barpoints.csv", "touches of a bar, for abbe identify mfb --points"},
    Purpose{"gauge.toml", "a step gauge on the line of a bar, for abbe identify bar"},
    Purpose{"parts.toml", "runs, ball arrays and bars for abbe identify joint"},
    Purpose{"errors.csv", "errors at the balls of an array, from another program or instrument"},
    Purpose{"points.csv", "positions for abbe model eval"},
    Purpose{"verification.csv", "readings and independent measurements for abbe verify"},
    Purpose{"measured.csv", "directly measured error motions for abbe model compare"},
    Purpose{"foxglove.json", "a layout for recordings in Foxglove or Lichtblick"},
    Purpose{"certificate.toml", "people, serial numbers and conditions for abbe report"},
    Purpose{"mtconnect-devices.xml", "the device for an MTConnect agent that reads abbe-mtconnect"},
    Purpose{"truth.csv", "the errors of a simulated machine"},
};

/// The name without extension: "path" of "path.csv".
std::string_view stem_of(const EmbeddedText& file) {
  return file.name.substr(0, file.name.find('.'));
}

const EmbeddedText* example_named(std::string_view name) {
  const auto files = example_files();
  const auto found = std::find_if(files.begin(), files.end(), [&](const EmbeddedText& file) {
    return file.name == name || stem_of(file) == name;
  });
  return found != files.end() ? &*found : nullptr;
}

std::string_view purpose_of(std::string_view name) {
  const auto found = std::ranges::find(kPurposes, name, &Purpose::name);
  return found != kPurposes.end() ? found->text : std::string_view{};
}

std::string list_of_examples() {
  std::string text;
  for (const EmbeddedText& file : example_files())
    text += fmt::format("{:<22} {}\n", file.name, purpose_of(file.name));
  return text + "\nabbe example NAME > NAME writes one of them.\n";
}

Error unknown_example(const std::string& name) {
  std::vector<std::string_view> known;
  for (const EmbeddedText& file : example_files()) known.push_back(file.name);
  for (const EmbeddedText& file : example_files()) known.push_back(stem_of(file));
  const auto* similar = example_named(nearest(name, known));
  Error error{ErrorCode::Usage, fmt::format("\"{}\" is not an example", name)};
  if (similar != nullptr) error.text += fmt::format(" (did you mean \"{}\"?)", similar->name);
  known.resize(example_files().size());
  error.details = {fmt::format("known: {}", fmt::join(known, ", "))};
  return error;
}

int print(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0)
    return report({ErrorCode::Io, "write the example to stdout: it is closed or full"});
  return 0;
}

int run_example(const std::string& name) {
  if (name.empty()) return print(list_of_examples());
  const auto* file = example_named(name);
  return file != nullptr ? print(file->text) : report(unknown_example(name));
}

}  // namespace

void add_example(CLI::App& parent, int& exit) {
  auto name = std::make_shared<std::string>();
  auto set = std::make_shared<std::string>();
  auto* command = parent.add_subcommand(
      "example",
      "Print a commented example of a file that abbe reads; without a name, list the examples.\n"
      "Columns, units and signs of every file: docs/files.md");
  auto* of_set =
      command
          ->add_option(
              "--set", *set,
              "otf, evemu, mfb or joint: writes the files of a simulated measurement, which "
              "fit each\nother, into a new folder NAME, and prints the commands that use them")
          ->check(CLI::IsMember({"otf", "evemu", "mfb", "joint"}));
  command->add_option("NAME", *name,
                      "name of the file: calibrator.toml; with --set: of the folder");
  command->callback([name, set, of_set, &exit] {
    exit =
        of_set->count() == 0 ? run_example(*name)
        : name->empty()
            ? report({ErrorCode::Usage,
                      fmt::format("--set {0} needs a folder: abbe example --set {0} FOLDER", *set)})
            : report(exec_program({"sim", "set", *set, "--out", *name}));
  });
}

}  // namespace abbe::daemon
