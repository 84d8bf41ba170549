#include "identified_model.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <CLI/Validators.hpp>

#include "abbe/base/printable.hpp"
#include "abbe/base/units.hpp"
#include "abbe/config/gate_conditions.hpp"
#include "terminal.hpp"

namespace abbe::daemon {

void add_accept_option(CLI::App& command, std::vector<std::string>& accept) {
  const auto known = gate_conditions();
  command
      .add_option("--accept", accept,
                  "do not refuse the model for this condition, beside those of [gate] accept; may "
                  "be repeated")
      ->allow_extra_args(false)
      ->check(CLI::IsMember(std::vector<std::string>(known.begin(), known.end())));
}

void add_pdf_option(CLI::App& command, std::string& pdf) {
  command.add_option("--pdf", pdf,
                     "also write the report as this PDF file; needs weasyprint or chromium");
}

void add_result_options(CLI::App& command, const ResultOptions& options) {
  command.add_option(
      "--keep", options.keep,
      "also add the model to this store, and compare it with its active model; to activate it,\n"
      "use abbe model activate");
  command.add_flag("--json", options.json, "print the summary as one JSON object");
  command.add_option("-o,--out", options.out, "folder for the results; created if needed")
      ->required();
  add_pdf_option(command, options.pdf);
}

void print_verdict(const calib::Verdict& verdict) {
  fmt::print("held out    {:.3f} um rms without compensation, {:.3f} um with the model\n",
             verdict.held_out.no_compensation_rms_m * kUmPerM,
             verdict.held_out.candidate_rms_m * kUmPerM);
  fmt::print("gate        {}\n", verdict.accepted
                                     ? coloured("would accept", kGreen, STDOUT_FILENO)
                                     : coloured("would refuse", kYellow, STDOUT_FILENO));
  for (const auto& reason : verdict.reasons) fmt::print("            {}\n", printable_line(reason));
  for (const auto& note : verdict.notes) fmt::print("note        {}\n", printable_line(note));
}

int exit_code(const calib::Verdict& verdict) {
  return verdict.accepted ? 0 : exit_code(ErrorCode::Refused);
}

}  // namespace abbe::daemon
