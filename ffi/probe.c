/* Preprocessed, never compiled: says which Embree is installed. */
#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
embree_version RTC_VERSION_MAJOR RTC_VERSION_STRING
#elif __has_include(<embree3/rtcore.h>)
#include <embree3/rtcore.h>
embree_version RTC_VERSION_MAJOR RTC_VERSION_STRING
#endif
