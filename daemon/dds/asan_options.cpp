// Disables one check of AddressSanitizer in programs with Fast DDS. Whenever Fast DDS 2.9.1 deletes
// a writer, it deletes the StatisticsWriterImpl through a base type of another size. Only the size
// given to operator delete is wrong, and the defect is outside abbe.
extern "C" const char* __asan_default_options();
extern "C" const char* __asan_default_options() {
  return "new_delete_type_mismatch=0";
}
