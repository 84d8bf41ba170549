#include "abbe/sim/truth_table.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <iterator>
#include <span>
#include <string>
#include <vector>

#include "abbe/protocol/table/number_table.hpp"
#include "table_error.hpp"
#include "units.hpp"

namespace abbe::sim {
namespace {

constexpr double kMicro = 1e-6;  // um in m, urad in rad
constexpr std::array<std::string_view, 3> kSquareness{"A0Z", "B0Z", "C0Y"};
constexpr std::array<std::string_view, 2> kUnits{"um", "urad"};
enum Column : std::size_t { kName, kPosition, kValue, kUnit };
constexpr std::string_view kBacklash = ".backlash";

struct Place {
  Axis axis{};
  std::size_t motion = 0;
};

std::optional<Place> place_of(std::string_view name) {
  if (name.size() != 3 || name[0] != 'E') return std::nullopt;
  const std::size_t motion = kMotionLetters.find(name[1]);
  const auto axis = axis_named(name.substr(2));
  if (motion == std::string_view::npos || !axis) return std::nullopt;
  return Place{*axis, motion};
}

/// All allowed names in column "name".
std::vector<std::string> error_names() {
  std::vector<std::string> names(kSquareness.begin(), kSquareness.end());
  for (const Axis axis : kAxes) {
    for (std::size_t m = 0; m < kMotions; ++m) {
      names.push_back(motion_name(m, axis));
      names.push_back(motion_name(m, axis) + std::string(kBacklash));
    }
  }
  return names;
}

std::string_view unit_of(std::size_t motion) {
  return motion < 3 ? "um" : "urad";
}

double* squareness_of(Squareness& s, std::string_view name) {
  if (name == kSquareness[0]) return &s.A0Z_rad;
  if (name == kSquareness[1]) return &s.B0Z_rad;
  if (name == kSquareness[2]) return &s.C0Y_rad;
  return nullptr;
}

/// Collects the rows of all errors first and then builds their functions, because the rows of an
/// error may be anywhere in the file.
class TruthReader {
 public:
  TruthReader(const protocol::NumberTable& table, std::span<const std::string> names,
              TruthMachine into, protocol::Faults& faults)
      : table_(table), names_(names), truth_(std::move(into)), faults_(faults) {
    truth_.squareness = {};
    for (AxisTruth& axis : truth_.axes) {
      axis.error = {};
      axis.backlash = {};
    }
  }

  void read(std::size_t row) {
    const std::string_view name = names_[static_cast<std::size_t>(table_.at(row, kName))];
    const double value = table_.at(row, kValue) * kMicro;
    if (double* square = squareness_of(truth_.squareness, name)) {
      expect_unit(row, "urad");
      *square = value;
      return;
    }

    const bool backlash = name.ends_with(kBacklash);
    const Place place = *place_of(backlash ? name.substr(0, name.size() - kBacklash.size()) : name);
    expect_unit(row, unit_of(place.motion));

    if (backlash)
      truth_.axis(place.axis).backlash[place.motion] = value;
    else
      add_node(row, place, value);
  }

  TruthMachine finish(Shape shape) {
    for (const Axis axis : kAxes) {
      for (std::size_t m = 0; m < kMotions; ++m) {
        Nodes& nodes = nodes_[static_cast<std::size_t>(axis)][m];
        if (nodes.at_m.empty()) continue;
        if (nodes.at_m.size() < 2) {
          faults_.add(nodes.line, 1, "", motion_name(m, axis) + " needs at least two nodes");
          continue;
        }
        truth_.axis(axis).error[m] =
            ErrorFunction(std::move(nodes.at_m), std::move(nodes.value), shape);
      }
    }

    return std::move(truth_);
  }

 private:
  struct Nodes {
    std::vector<double> at_m, value;
    std::size_t line = 0;
  };

  void expect_unit(std::size_t row, std::string_view unit) {
    const std::string_view given = kUnits[static_cast<std::size_t>(table_.at(row, kUnit))];
    if (given != unit)
      faults_.add(table_.line(row), 1, "unit",
                  fmt::format("\"{}\" instead of \"{}\"", given, unit));
  }
  void add_node(std::size_t row, Place place, double value) {
    Nodes& nodes = nodes_[static_cast<std::size_t>(place.axis)][place.motion];
    const double at_m = table_.at(row, kPosition) * kMPerMm;
    if (std::isnan(at_m)) return faults_.add(table_.line(row), 1, "position_mm", "empty");
    if (!nodes.at_m.empty() && at_m <= nodes.at_m.back())
      return faults_.add(table_.line(row), 1, "position_mm", "nodes of one error must ascend");
    nodes.line = table_.line(row);
    nodes.at_m.push_back(at_m);
    nodes.value.push_back(value);
  }

  const protocol::NumberTable& table_;
  std::span<const std::string> names_;
  TruthMachine truth_;
  protocol::Faults& faults_;
  std::array<std::array<Nodes, kMotions>, 3> nodes_;
};

}  // namespace

Result<TruthMachine> parse_truth_csv(std::string_view text, std::string_view name,
                                     TruthMachine into, Shape shape) {
  protocol::Faults faults{std::string(name)};
  const std::vector<std::string> names = error_names();
  const auto table =
      protocol::parse_numbers(text,
                              {{{.name = "name", .words = {names.begin(), names.end()}},
                                {.name = "position_mm", .may_be_empty = true},
                                {"value"},
                                {.name = "unit", .words = {kUnits.begin(), kUnits.end()}}}},
                              faults);
  if (!table) return tl::unexpected(table_error(faults));

  TruthReader reader(*table, names, std::move(into), faults);
  for (std::size_t row = 0; row < table->rows(); ++row)
    if (table->sound(row)) reader.read(row);
  TruthMachine truth = reader.finish(shape);
  if (faults.any()) return tl::unexpected(table_error(faults));
  return truth;
}

std::string format_truth_csv(const TruthMachine& truth) {
  std::string out = "name,position_mm,value,unit\n";
  const auto row = [&](std::string_view name, double at_m, double value, std::string_view unit) {
    fmt::format_to(std::back_inserter(out), "{},{:.17g},{:.17g},{}\n", name, at_m / kMPerMm,
                   value / kMicro, unit);
  };

  for (const Axis axis : kAxes) {
    for (std::size_t m = 0; m < kMotions; ++m) {
      const ErrorFunction& f = truth.axis(axis).error[m];
      for (std::size_t i = 0; i < f.nodes_m().size(); ++i) {
        row(motion_name(m, axis), f.nodes_m()[i], f.values()[i], unit_of(m));
      }
      const double backlash = truth.axis(axis).backlash[m];
      if (backlash != 0.0)
        row(motion_name(m, axis) + std::string(kBacklash), 0.0, backlash, unit_of(m));
    }
  }

  row("A0Z", 0.0, truth.squareness.A0Z_rad, "urad");
  row("B0Z", 0.0, truth.squareness.B0Z_rad, "urad");
  row("C0Y", 0.0, truth.squareness.C0Y_rad, "urad");

  return out;
}

}  // namespace abbe::sim
