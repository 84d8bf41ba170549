#include "abbe/protocol/lines/value_line.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <initializer_list>
#include <string_view>

namespace abbe::protocol::lines {
namespace {

/// "X", "Y", ... in mm, "time", "status", "-".
ValueFormat values_of(std::initializer_list<std::string_view> names) {
  ValueFormat format;
  for (const auto name : names) {
    ValueColumn& column = format.columns[format.column_count];
    format.names[format.column_count++] = name;
    if (name == "time")
      column.use = ColumnUse::Time;
    else if (name == "status")
      column.use = ColumnUse::Status;
    else if (name != "-")
      column = {.use = ColumnUse::Value,
                .value = static_cast<std::uint8_t>(format.value_count++),
                .scale = 1e-3,
                .offset = 0.0,
                .limit = 1000.0};
  }
  format.valid_status[0] = StatusWord::from("OK").value();
  format.valid_status_count = 1;
  return format;
}

void expect_value_fault(std::string_view line, const ValueFormat& format, LineFault::What what,
                        int column) {
  const auto decoded = decode(line, format);
  ASSERT_FALSE(decoded) << line;
  EXPECT_EQ(decoded.error().what, what) << line;
  EXPECT_EQ(decoded.error().column, column) << line;
}

TEST(ValueLine, ReadsColumnsInAnyOrder) {
  const auto line = decode("OK 3 N17 12.5 1000", values_of({"status", "Z", "-", "time", "X"}));
  ASSERT_TRUE(line);
  EXPECT_DOUBLE_EQ(line->value[0], 0.003);
  EXPECT_DOUBLE_EQ(line->value[1], 1.0);
  EXPECT_EQ(line->time->time_since_epoch(), std::chrono::milliseconds{12'500});
  EXPECT_TRUE(line->valid);
  EXPECT_FALSE(decode("no 3 N17 12.5 1000", values_of({"status", "Z", "-", "time", "X"}))->valid);
}

TEST(ValueLine, ConvertsWithScaleAndOffset) {
  auto format = values_of({"X"});
  format.columns[0].scale = -1e-3;
  format.columns[0].offset = 0.5;
  EXPECT_DOUBLE_EQ(decode("200", format)->value[0], 0.3);
}

TEST(ValueLine, HasNoValueWhereAWordSaysSo) {
  auto format = values_of({"X", "Y"});
  format.no_value[0] = StatusWord::from("---").value();
  format.no_value_count = 1;
  const auto line = decode("--- 2", format);
  ASSERT_TRUE(line);
  EXPECT_TRUE(std::isnan(line->value[0]));
  EXPECT_DOUBLE_EQ(line->value[1], 2e-3);
  expect_value_fault("2 ?", format, LineFault::What::NotANumber, 2);
}

TEST(ValueLine, NamesTheColumnThatCannotBeRead) {
  const auto format = values_of({"time", "X", "Y"});
  EXPECT_EQ(column_name(format, 2), "Y");
  expect_value_fault("1 2", format, LineFault::What::MissingColumn, 3);
  expect_value_fault("1 2 3 4", format, LineFault::What::TooManyColumns, 4);
  expect_value_fault("1 2 nan", format, LineFault::What::NotANumber, 3);
  expect_value_fault("12:30 2 3", format, LineFault::What::NotANumber, 1);
  expect_value_fault("1 2 1000001", format, LineFault::What::OutOfRange, 3);
}

TEST(ValueFormat, NamesWhatIsWrong) {
  EXPECT_EQ(format_fault(values_of({"time", "X", "-", "status"})), "");
  EXPECT_NE(format_fault(values_of({"time", "status"})), "");
  EXPECT_NE(format_fault(values_of({"time", "X", "time"})), "");
  auto twice = values_of({"X", "Y"});
  twice.columns[1].value = 0;
  EXPECT_NE(format_fault(twice), "");
  auto one_sign = values_of({"X"});
  one_sign.separator = one_sign.decimal_sign = ',';
  EXPECT_NE(format_fault(one_sign), "");
}

}  // namespace
}  // namespace abbe::protocol::lines
