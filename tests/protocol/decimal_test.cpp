#include "abbe/protocol/decimal.hpp"

#include <gmock/gmock.h>

namespace abbe::protocol {
namespace {

using ::testing::HasSubstr;

TEST(ParseDecimal, ReadsWhatTablesContain) {
  for (const auto& [text, wanted] : {std::pair{"1.5", 1.5},
                                     {"-2e-3", -2e-3},
                                     {"+3", 3.0},
                                     {"010", 10.0},
                                     {".5", 0.5},
                                     {"5.", 5.0}}) {
    double value = 0.0;
    EXPECT_EQ(parse_decimal(text, value), "") << text;
    EXPECT_EQ(value, wanted) << text;
  }
}

TEST(ParseDecimal, RefusesOtherNotations) {
  for (const char* text :
       {"+-100", "--1", "++1", "0x10", "0x1p3", "1e", "1_000", "1,5", " 1", "1 ", "1 000"}) {
    double value = 0.0;
    EXPECT_EQ(parse_decimal(text, value), "not a number") << text;
  }
  double value = 0.0;
  for (const char* text : {"inf", "nan", "-infinity"})
    EXPECT_EQ(parse_decimal(text, value), "must be finite") << text;
  EXPECT_EQ(parse_decimal("1e999", value), "out of range");
  EXPECT_EQ(parse_decimal("", value), "empty");
}

TEST(DecimalFault, AcceptsDecimalNumbers) {
  using enum DecimalKind;
  for (const char* text : {"0", "10", "-3", "+3"}) EXPECT_EQ(decimal_fault(text, Whole), "");
  for (const char* text : {"0.5", "-1e-3", "1000000", ".5"})
    EXPECT_EQ(decimal_fault(text, Any), "");
  EXPECT_EQ(decimal_fault("65535", WholeNotNegative), "");
}

TEST(DecimalFault, NamesWhatIsNotOne) {
  using enum DecimalKind;
  for (const char* text : {"0x10", "+-5", "1e", "1_000", "1,5", "0x1p3", "five"})
    EXPECT_THAT(decimal_fault(text, Any), HasSubstr("not a decimal number")) << text;
  for (const char* text : {"010", "-010", "00"})
    EXPECT_THAT(decimal_fault(text, Whole), HasSubstr("leading zeros")) << text;
  EXPECT_THAT(decimal_fault("nan", Any), HasSubstr("must be finite"));
  EXPECT_THAT(decimal_fault("1.5", Whole), HasSubstr("must be a whole number"));
  EXPECT_THAT(decimal_fault("-1", WholeNotNegative), HasSubstr("must not be negative"));
  EXPECT_THAT(decimal_fault("", Any), HasSubstr("empty"));
  EXPECT_THAT(decimal_fault("\xe2\x88\x92"
                            "5",
                            Any),
              HasSubstr("U+2212 (minus sign)"));
}

}  // namespace
}  // namespace abbe::protocol
