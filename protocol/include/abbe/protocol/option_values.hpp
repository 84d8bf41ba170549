#pragma once
/// Checks the values of command line options and escapes messages about them, the same in every
/// program. CLI11 reads whole numbers as C does (010 is 8, 0x10 is 16), accepts inf and nan, takes
/// an empty value for an absent option, and prints the bytes of a wrong argument as they are.

#include <string>

#include "abbe/protocol/decimal.hpp"
#include "abbe/protocol/printable.hpp"

namespace abbe::protocol {

/// Adds the checks to all options of `app` and of its subcommands: a value must not be empty, and a
/// number must be decimal. The type of an option determines whether it is a number. Messages about
/// a wrong command line escape characters that are not printable. Call it after the last option was
/// added, before parse(). `App`: CLI::App; a template, so that this module does not
/// depend on CLI11.
template <class App>
void check_option_values(App& app) {
  app.failure_message([](const auto* wrong, const auto& error) {
    return printable(error.what()) + "\nsee `" + wrong->get_name() + " --help`\n";
  });
  for (auto* option : app.get_options()) {
    if (option->get_items_expected_max() == 0) continue;  // a flag
    const std::string type = option->get_type_name();
    const bool whole = type.starts_with("INT"), whole_positive = type.starts_with("UINT");
    const bool number = whole || whole_positive || type.starts_with("FLOAT");
    const DecimalKind kind = whole            ? DecimalKind::Whole
                             : whole_positive ? DecimalKind::WholeNotNegative
                                              : DecimalKind::Any;
    option->check([number, kind](const std::string& value) -> std::string {
      if (number) return decimal_fault(value, kind);
      return value.empty() ? "empty, needs a value" : "";
    });
  }
  for (App* command : app.get_subcommands([](App*) { return true; })) check_option_values(*command);
}

}  // namespace abbe::protocol
