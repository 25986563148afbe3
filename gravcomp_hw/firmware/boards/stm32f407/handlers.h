// What the table of vectors names.
#ifndef GC_HANDLERS_H
#define GC_HANDLERS_H

void gc_reset(void);
void gc_stuck(void);
void gc_on_tick(void);
void gc_on_edge(void);
void gc_on_data_ready(void);
void gc_on_host_frame(void);
void gc_on_motor_frame(void);
void gc_on_host_sent(void);
void gc_on_motor_sent(void);
int main(void);

#endif
