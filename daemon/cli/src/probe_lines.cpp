/// `abbe probe-lines`: shows what a program sends as lines, and writes the table for abbed.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <system_error>

#include "abbe/base/exit_codes.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/output_files.hpp"
#include "abbe/tasks/probe_lines.hpp"
#include "commands.hpp"
#include "interruption.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

struct ProbeLinesArguments {
  ProbeLinesCommand command;
  double duration_s = 5.0;
  double wait_s = 30.0;
  std::string frame;
  std::string out;
  bool replace = false;
};

std::chrono::nanoseconds nanoseconds_of(double s) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(s));
}

double milliseconds_of(std::chrono::nanoseconds d) {
  return std::chrono::duration<double, std::milli>(d).count();
}

Result<void> require_free_file(const ProbeLinesArguments& arguments) {
  if (arguments.out.empty()) return {};
  ABBE_TRY(require_place_of(arguments.out));
  std::error_code ignored;
  if (arguments.replace || !std::filesystem::exists(arguments.out, ignored)) return {};
  return fail(
      ErrorCode::Refused,
      fmt::format("write {}: it exists: choose another name, or add --replace", arguments.out));
}

std::string text_of(const drivers::SurveyedColumn& column) {
  if (!column.numbers || (!column.rises && !column.words.empty())) {
    if (column.words.empty()) return "texts";
    std::string text;
    for (const auto& [word, times] : column.words)
      text += fmt::format("{}\"{}\" ({})", text.empty() ? "" : ", ", printable_line(word), times);
    return text;
  }
  std::string text = fmt::format("numbers from {:.10g} to {:.10g}", column.least, column.greatest);
  if (column.time)
    text += fmt::format("; advances as a time in {}, by {:.6g} from line to line",
                        time_unit_word(*column.time), column.step);
  else if (column.rises)
    text += fmt::format("; rises by {:.6g} from line to line; not shown to be a time", column.step);
  return text;
}

void print_rate(const ProbedLines& probed) {
  const auto& found = probed.findings;
  fmt::print("{}: {} lines in {:.1f} s, {:.4g} per second", probed.where, found.lines,
             1e-3 * milliseconds_of(found.span), found.lines_per_s);
  if (found.burst_period.count() > 0)
    fmt::print(", in bursts of at most {} every {:.0f} ms", found.most_in_burst,
               milliseconds_of(found.burst_period));
  fmt::print("\n");
  if (!probed.ended.empty()) fmt::print("ended early: {}\n", probed.ended);
  if (!found.heading.empty()) fmt::print("heading: {}\n", printable_line(found.heading));
  for (const auto& line : probed.shown) fmt::print("  {}\n", printable_line(line));
}

void print_columns(const ProbedLines& probed, const StatedLines& stated) {
  const auto& found = probed.findings;
  if (found.splits.empty()) {
    fmt::print("no separator gives at least 3 columns of numbers in every line\n");
    return;
  }
  for (const auto& split : found.splits)
    fmt::print("{} columns, separator {}, decimal {}{}\n", found.columns.size(),
               separator_word(split.separator), decimal_word(split.decimal_sign),
               &split == &found.splits.front() ? "" : " (also possible)");
  if (found.different > 0) fmt::print("{} lines have another number of columns\n", found.different);
  for (std::size_t i = 0; i < found.columns.size(); ++i)
    fmt::print("  {:>2} {:<10}{}\n", i + 1, i < stated.columns.size() ? stated.columns[i] : "?",
               text_of(found.columns[i]));
}

void print_understood(const UnderstoodLines& understood) {
  fmt::print("understood: {} points, {} of them invalid by their status; {} lines cannot be read\n",
             understood.points, understood.invalid, understood.unreadable);
  if (!understood.first_fault.empty()) fmt::print("  {}\n", understood.first_fault);
  if (understood.points == 0) return;
  fmt::print("  latest point:");
  for (const auto& [column, value] : understood.latest) fmt::print(" {} {}", column, value);
  constexpr double kMmPerMetre = 1e3;
  fmt::print("\n  distance from the tracker: {:.1f} to {:.1f} mm\n",
             kMmPerMetre * understood.least_distance_m,
             kMmPerMetre * understood.greatest_distance_m);
}

/// A table that the lines contradict is not written.
Result<void> require_agreement(const ProbedLines& probed, const std::string& out) {
  constexpr double kMostUnreadable = 0.05;
  std::vector<std::string> faults = probed.notes;
  const auto& understood = *probed.understood;
  const auto lines = static_cast<double>(understood.points + understood.unreadable);
  if (static_cast<double>(understood.unreadable) > kMostUnreadable * lines)
    faults.push_back(fmt::format("{} of {:.0f} lines cannot be read: {}", understood.unreadable,
                                 lines, understood.first_fault));
  if (understood.invalid == understood.points)
    faults.emplace_back("every point is invalid by its status: --valid-status");
  if (faults.empty()) return {};
  return tl::make_unexpected(Error{ErrorCode::DataInsufficient,
                                   fmt::format("{} is not written: the lines contradict it", out),
                                   std::move(faults)});
}

/// With a table that is incomplete, and a file to write it to, or columns that do not fit.
Result<void> require_table(const ProbedLines& probed, const ProbeLinesArguments& arguments) {
  const auto& understood = probed.understood;
  if (understood && understood->points == 0)
    return fail(ErrorCode::DataInsufficient,
                fmt::format("{}: no line can be read with these columns: {}", probed.where,
                            understood->first_fault));
  if (arguments.out.empty()) return {};
  if (!probed.missing.empty())
    return tl::make_unexpected(Error{ErrorCode::Usage,
                                     fmt::format("write {}: options are missing", arguments.out),
                                     probed.missing});
  return require_agreement(probed, arguments.out);
}

void print_missing(const ProbedLines& probed) {
  fmt::print("missing options for a table of the configuration:\n");
  for (const auto& missing : probed.missing) fmt::print("  {}\n", missing);
}

int give_table(const ProbedLines& probed, const ProbeLinesArguments& arguments) {
  if (probed.table.empty()) {
    print_missing(probed);
    return 0;
  }
  if (arguments.out.empty()) {
    fmt::print("\n{}", probed.table);
    return 0;
  }
  if (const auto free = require_free_file(arguments); !free) return report(free.error());
  if (const auto written = replace_file(arguments.out, probed.table); !written)
    return report(written.error());
  fmt::print("wrote {}: copy it into abbed.toml, then: abbed --check-config abbed.toml\n",
             arguments.out);
  return 0;
}

int run_probe_lines(ProbeLinesArguments& arguments) {
  if (const auto free = require_free_file(arguments); !free) return report(free.error());
  auto& command = arguments.command;
  command.duration = nanoseconds_of(arguments.duration_s);
  command.longest_wait = nanoseconds_of(arguments.wait_s);
  command.tracker_frame = !arguments.frame.empty();

  mark_interruptions({SIGINT, SIGTERM});
  ProgressBar bar;
  const drivers::MonotonicTime time;
  const auto probed = probe_lines(command, time, bar.progress(interrupted));
  bar.clear();
  if (!probed) return report(probed.error());
  if (probed->findings.lines == 0) {
    fmt::print(stderr, "{}: interrupted before the first line\n", probed->where);
    return number(ExitCode::Interrupted);
  }

  print_rate(*probed);
  print_columns(*probed, command.stated);
  if (probed->understood) print_understood(*probed->understood);
  for (const auto& note : probed->notes) fmt::print("contradiction: {}\n", note);
  if (interrupted()) return number(ExitCode::Interrupted);
  if (const auto enough = require_table(*probed, arguments); !enough) return report(enough.error());
  return give_table(*probed, arguments);
}

void add_address_options(CLI::App& command, StatedLines& stated) {
  command
      .add_option("--transport", stated.transport,
                  "tcp: abbe connects to --host, --port; tcp-server, udp: the program sends to "
                  "--port of --host, an address of this computer (0.0.0.0: all); serial")
      ->check(CLI::IsMember({"tcp", "tcp-server", "udp", "serial"}))
      ->capture_default_str();
  command.add_option("--host", stated.host, "host name or address");
  command.add_option("--port", stated.port)->check(CLI::Range(1, 65535));
  command.add_option("--serial", stated.serial, "path of the serial line");
  command.add_option("--baud", stated.baud, "default 115200")->check(CLI::Range(300, 1'000'000));
  command.add_option("--parity", stated.parity, "default none")
      ->check(CLI::IsMember({"none", "even", "odd"}));
  command.add_option("--stop-bits", stated.stop_bits, "default 1")->check(CLI::Range(1, 2));
}

void add_format_options(CLI::App& command, ProbeLinesArguments& arguments) {
  StatedLines& stated = arguments.command.stated;
  command
      .add_option("--columns", stated.columns,
                  "time,x,y,z,status in the order of a line; or range,azimuth,elevation (or "
                  "zenith); - is ignored")
      ->delimiter(',');
  command
      .add_option("--valid-status", stated.valid_status,
                  "words of the status column of points that may be used: 0,OK")
      ->delimiter(',');
  command.add_option("--length-unit", stated.length_unit)
      ->check(CLI::IsMember({"mm", "m", "um", "inch"}));
  command.add_option("--angle-unit", stated.angle_unit)
      ->check(CLI::IsMember({"rad", "deg", "gon", "mrad"}));
  command.add_option("--time-unit", stated.time_unit, "default: as the time column advances")
      ->check(CLI::IsMember({"s", "ms", "us", "ns"}));
  command.add_option("--separator", stated.separator, "default: as the lines show")
      ->check(CLI::IsMember({"space", "tab", "comma", "semicolon"}));
  command.add_option("--decimal", stated.decimal, "default: as the lines show")
      ->check(CLI::IsMember({"point", "comma"}));
  command
      .add_option("--point-rate-hz", stated.point_rate_hz,
                  "points per second; default: as the time column shows")
      ->check(CLI::Range(0.1, 10e3));
  command
      .add_option("--stationary-time-ms", stated.stationary_time_ms,
                  "instead of a rate: each line is a mean over this time")
      ->check(CLI::Range(1, 60'000));
  command
      .add_option("--weather", stated.weather,
                  "compute: the program corrects distances for measured air; none")
      ->check(CLI::IsMember({"compute", "none"}));
  command
      .add_option("--frame", arguments.frame,
                  "tracker: states that coordinates are in the frame of the tracker itself, z up; "
                  "abbe reads no other frame")
      ->check(CLI::IsMember({"tracker"}));
}

}  // namespace

void add_probe_lines(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<ProbeLinesArguments>();
  auto* command = parent.add_subcommand(
      "probe-lines",
      "Receive the lines of text that a measuring program sends, show what they are, and write\n"
      "its table for abbed.toml. Separator, time column and rate are found if the lines\n"
      "prove them; state the columns, units and frame. No daemon is needed; stop abbed first if "
      "it\n"
      "uses the same port. Ctrl-C ends early and shows what was received (exit code 130).");
  add_address_options(*command, arguments->command.stated);
  add_format_options(*command, *arguments);
  command->add_option("--duration-s", arguments->duration_s, "from the first line on")
      ->check(CLI::Range(0.5, 600.0))
      ->capture_default_str();
  command->add_option("--wait-s", arguments->wait_s, "for the first line")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  command->add_option("-o,--out", arguments->out, "file to write the table to");
  command->add_flag("--replace", arguments->replace, "replace the file of --out");
  command->callback([arguments, &exit] { exit = run_probe_lines(*arguments); });
}

}  // namespace abbe::daemon
